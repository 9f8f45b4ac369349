"""Decoding of the registers read in one poll to the numbers of cells and the values of a map."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from acquisition.modbus.cells import DTYPES, N_BYTES, ByteOrder, Cell, NumberType, reads_as
from acquisition.modbus.read_plan import ReadPlan, plan_reads
from acquisition.modbus.register_map import FlagCheck, MapValue, Meaning, RegisterMap
from acquisition.modbus.requests import BIT_FUNCTIONS
from core.arrays import FloatArray


class ValueState(IntEnum):
    """State of a polled value; the members are in order from the best state to the worst."""

    OK = 0
    CLIPPED = 1
    INVALID = 2
    FLAGGED = 3


@dataclass(frozen=True)
class MapReading:
    """Values of one poll of a device, in the order of its register map.

    Parameters
    ----------
    values
        (n_values,) values in the units of their channels, also those whose state is not OK.
    states
        (n_values,) state of each value.
    time_ns
        Device time, UTC ns since 1970; None if the map has no time or the time is invalid.
    alive
        Bytes that change with each new measurement, to detect a device that has stopped measuring:
        the heartbeat, else the device time, else the contents of all registers read.
    """

    values: FloatArray
    states: tuple[ValueState, ...]
    time_ns: int | None
    alive: bytes


class CellDecoder:
    """Decoder of the number in each cell from the registers and bits that a read plan reads."""

    def __init__(self, cells: Sequence[Cell], plan: ReadPlan) -> None:
        self._places: dict[Cell, tuple[tuple[int, ...], np.dtype[np.generic], int | None]] = {}
        for cell in cells:
            start, coil_bit = plan.place_of(cell)
            if cell.function in BIT_FUNCTIONS:
                self._places[cell] = (start,), np.dtype(np.uint8), coil_bit
                continue
            positions = (start + n for n in byte_permutation(cell.type, cell.byte_order))
            self._places[cell] = tuple(positions), np.dtype(DTYPES[cell.type]), cell.bit

    def numbers(self, content: bytes) -> Mapping[Cell, float]:
        """Return the unscaled number of each cell from the concatenated contents of all spans."""
        numbers = {}
        for cell, (positions, dtype, bit) in self._places.items():
            number = np.frombuffer(bytes([content[n] for n in positions]), dtype)[0].item()
            numbers[cell] = float(number if bit is None else number >> bit & 1)
        return numbers


class MapDecoder:
    """Decoder of one poll of a device to the values of its register map.

    Raises MapError if cells that the map requires in one request cannot be read in one request.
    """

    def __init__(self, registers: RegisterMap) -> None:
        self.map = registers
        self.plan = plan_reads(registers)
        self._cells = CellDecoder(list(registers.cells()), self.plan)
        self._time_cells = list(registers.time.cells()) if registers.time else []

    def read(self, content: bytes) -> MapReading:
        """Decode the contents read in one poll; return all values with their states.

        `content` are the concatenated contents of all spans of the plan.
        """
        numbers = self._cells.numbers(content)
        times = [numbers[cell] for cell in self._time_cells]
        values = [_value(value, numbers) for value in self.map.values]
        alive = content
        if self.map.heartbeat is not None:
            alive = np.float64(numbers[self.map.heartbeat]).tobytes()
        elif times:
            alive = np.array(times).tobytes()
        return MapReading(
            values=np.array(values),
            states=tuple(
                _state(value, numbers, found)
                for value, found in zip(self.map.values, values, strict=True)
            ),
            time_ns=None if self.map.time is None else self.map.time.time_ns(times),
            alive=alive,
        )


def _value(value: MapValue, numbers: Mapping[Cell, float]) -> float:
    """Return a value in the unit of its channel; NaN if its scale register or its range is 0."""
    scaled = numbers[value.cell]
    if value.scale_register is not None:
        register = numbers[value.scale_register.cell]
        scaled *= register / value.scale_register.divisor if register else math.nan
    elif value.full_scale is not None:
        span = value.full_scale
        low, high = (
            numbers[end] if isinstance(end, Cell) else end for end in (span.minimum, span.maximum)
        )
        share = (scaled - span.raw_minimum) / (span.raw_maximum - span.raw_minimum)
        scaled = low + share * (high - low) if low != high else math.nan
    return scaled * value.scale + value.offset


def _state(value: MapValue, numbers: Mapping[Cell, float], found: float) -> ValueState:
    """Return the worst state that range, invalid numbers and status flags of a value indicate."""
    raw, span = numbers[value.cell], value.full_scale
    states = [flag_state(flag, int(numbers[flag.cell])) for flag in value.flags]
    if span is not None and not span.raw_minimum < raw < span.raw_maximum:
        states.append(ValueState.CLIPPED)
    is_valid = math.isfinite(found) and value.invalid_below <= raw <= value.invalid_above
    if not is_valid or any(reads_as(raw, value.cell.type, n) for n in value.invalid_values):
        states.append(ValueState.INVALID)
    return max(states, default=ValueState.OK)


def flag_state(flag: FlagCheck, word: int) -> ValueState:
    """Return the state of a value that the content `word` of its status register indicates."""
    masked = word & flag.mask
    if flag.set_means is Meaning.BAD:
        return ValueState.FLAGGED if masked else ValueState.OK
    if flag.set_means is Meaning.OK:
        return ValueState.OK if masked == flag.mask else ValueState.FLAGGED
    number = masked // flag.lowest_bit
    if number in flag.clipped_values:
        return ValueState.CLIPPED
    return ValueState.OK if number in flag.ok_values else ValueState.FLAGGED


def byte_permutation(type_: NumberType, order: ByteOrder) -> list[int]:
    """Return the position of each byte of a number on the wire, most significant byte first.

    Position 0 is the first byte of the first register.
    """
    n_words = N_BYTES[type_] // 2
    words = range(n_words)
    ordered = reversed(words) if order.low_word_first else words
    pair = (1, 0) if order.low_byte_first else (0, 1)
    return [2 * word + byte for word in ordered for byte in pair]
