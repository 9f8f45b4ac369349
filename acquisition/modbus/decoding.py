"""From the bytes of all replies to the numbers of all cells, and to the values of a map."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from acquisition.modbus.cells import (
    BIT_FUNCTIONS,
    DTYPES,
    N_BYTES,
    ByteOrder,
    Cell,
    NumberType,
    reads_as,
)
from acquisition.modbus.read_plan import ReadPlan, plan_reads
from acquisition.modbus.register_map import FlagCheck, Meaning, RegisterMap
from core.arrays import FloatArray


class ValueState(IntEnum):
    """Whether a device gives a value; ordered from best to worst."""

    OK = 0
    CLIPPED = 1
    INVALID = 2
    FLAGGED = 3


@dataclass(frozen=True)
class MapReading:
    """What one poll has found.

    Parameters
    ----------
    values
        (n_values,) as the device gives them, whatever their state.
    states
        One for each value.
    time_ns
        By the device's clock, if the map has one and it makes sense.
    alive
        What must change from time to time, if the device lives.
    """

    values: FloatArray
    states: tuple[ValueState, ...]
    time_ns: int | None
    alive: bytes


class CellDecoder:
    """Numbers of cells from the bytes of all replies of a plan."""

    def __init__(self, cells: Sequence[Cell], plan: ReadPlan) -> None:
        self._n_cells = len(cells)
        self.n_bytes = sum(request.n_bytes for request in plan.requests)
        self._groups = [
            (np.dtype(DTYPES[type_]), np.array(rows), _byte_positions(type_, rows, cells, plan))
            for type_ in NumberType
            if (rows := _rows_in_registers(type_, cells))
        ]
        bits = [(n, c.bit) for n, c in enumerate(cells) if c.bit is not None]
        self._bit_rows = np.array([n for n, _ in bits], dtype=np.intp)
        self._bits = np.array([bit for _, bit in bits], dtype=np.int64)
        single = [(n, c) for n, c in enumerate(cells) if c.function in BIT_FUNCTIONS]
        self._single_rows = np.array([n for n, _ in single], dtype=np.intp)
        self._single_bytes = np.array([plan.byte_of(c) for _, c in single], dtype=np.intp)
        self._single_bits = np.array([plan.bit_of(c) for _, c in single], dtype=np.intp)

    def numbers(self, content: bytes) -> FloatArray:
        """(n_cells,) as they stand in the device.

        Raises
        ------
        ValueError
            If the content has not the length of the plan's replies.
        """
        if len(content) != self.n_bytes:
            raise ValueError(f"{len(content)} bytes instead of {self.n_bytes}")
        data = np.frombuffer(content, dtype=np.uint8)
        numbers = np.zeros(self._n_cells)
        for dtype, rows, positions in self._groups:
            numbers[rows] = data[positions].view(dtype)[:, 0]
        words = numbers[self._bit_rows].astype(np.int64)
        numbers[self._bit_rows] = words >> self._bits & 1
        numbers[self._single_rows] = data[self._single_bytes] >> self._single_bits & 1
        return numbers


class MapDecoder:
    """Values of a map from the bytes of all replies of its plan.

    Raises
    ------
    MapError
        If the map cannot be read as it demands.
    """

    def __init__(self, registers: RegisterMap) -> None:
        self.map = registers
        self.plan = plan_reads(registers)
        cells = [cell for cell, _ in registers.cells()]
        self._cells = CellDecoder(cells, self.plan)
        index = {cell: n for n, cell in enumerate(cells)}
        self._index = index
        values = registers.values
        self._own = np.array([index[value.cell] for value in values], dtype=np.intp)
        self._scale = np.array([value.scale for value in values])
        self._offset = np.array([value.offset for value in values])
        self._below = np.array([value.invalid_below for value in values])
        self._above = np.array([value.invalid_above for value in values])
        self._time = registers.time
        time_cells = list(registers.time.cells()) if registers.time else []
        self._time_rows = [index[cell] for cell in time_cells]

    def read(self, content: bytes) -> MapReading:
        """Decode one poll.

        Parameters
        ----------
        content
            All replies, one after the other.
        """
        numbers = self._cells.numbers(content)
        raw = numbers[self._own]
        values = self._scaled(raw, numbers)
        states = tuple(map(ValueState, self._states(raw, values, numbers).tolist()))
        time = None
        if self._time is not None:
            time = self._time.time_ns(numbers[self._time_rows].tolist())
        return MapReading(values, states, time, self._alive(numbers, content))

    def _scaled(self, raw: FloatArray, numbers: FloatArray) -> FloatArray:
        scaled = raw.copy()
        for n, value in enumerate(self.map.values):
            if value.scale_register is not None:
                register = numbers[self._index[value.scale_register.cell]]
                scaled[n] *= register / value.scale_register.divisor if register else np.nan
            elif value.full_scale is not None:
                span = value.full_scale
                low, high = (self._end(end, numbers) for end in (span.minimum, span.maximum))
                share = (raw[n] - span.raw_minimum) / (span.raw_maximum - span.raw_minimum)
                scaled[n] = low + share * (high - low) if low != high else np.nan
        result: FloatArray = scaled * self._scale + self._offset
        return result

    def _end(self, end: float | Cell, numbers: FloatArray) -> float:
        return float(numbers[self._index[end]]) if isinstance(end, Cell) else end

    def _states(
        self, raw: FloatArray, values: FloatArray, numbers: FloatArray
    ) -> npt.NDArray[np.int64]:
        states = np.zeros(raw.size, dtype=np.int64)
        valid = np.isfinite(values) & (raw >= self._below) & (raw <= self._above)
        states[~valid] = ValueState.INVALID
        for n, value in enumerate(self.map.values):
            span = value.full_scale
            if span is not None and not span.raw_minimum < raw[n] < span.raw_maximum:
                states[n] = max(states[n], ValueState.CLIPPED)
            if any(reads_as(raw[n], value.cell.type, number) for number in value.invalid_values):
                states[n] = ValueState.INVALID
            for flag in value.flags:
                word = int(numbers[self._index[flag.cell]])
                states[n] = max(states[n], flag_state(flag, word))
        return states

    def _alive(self, numbers: FloatArray, content: bytes) -> bytes:
        """The heartbeat, else the time, else all that was read."""
        if self.map.heartbeat is not None:
            return bytes(numbers[self._index[self.map.heartbeat]].tobytes())
        if self._time_rows:
            return numbers[self._time_rows].tobytes()
        return content


def flag_state(flag: FlagCheck, word: int) -> ValueState:
    """What a status register says of a value."""
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
    """Where the bytes of a number stand, most significant first, counted from its first one."""
    n_words = N_BYTES[type_] // 2
    words = range(n_words)
    ordered = reversed(words) if order.low_word_first else words
    pair = (1, 0) if order.low_byte_first else (0, 1)
    return [2 * word + byte for word in ordered for byte in pair]


def _rows_in_registers(type_: NumberType, cells: Sequence[Cell]) -> list[int]:
    return [n for n, c in enumerate(cells) if c.type is type_ and c.function not in BIT_FUNCTIONS]


def _byte_positions(
    type_: NumberType, rows: Sequence[int], cells: Sequence[Cell], plan: ReadPlan
) -> npt.NDArray[np.intp]:
    """(n_rows, n_bytes) of the content, most significant byte first."""
    return np.array(
        [
            [plan.byte_of(cells[n]) + p for p in byte_permutation(type_, cells[n].byte_order)]
            for n in rows
        ],
        dtype=np.intp,
    )
