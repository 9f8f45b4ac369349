"""Register contents of simulated Modbus devices: values of a register map, slots of a ring."""

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np

from acquisition.modbus.cells import DTYPES, FLOATS, N_BYTES, Cell, NumberType
from acquisition.modbus.decoding import byte_permutation
from acquisition.modbus.register_map import EpochTime, FlagCheck, MapValue, Meaning, RegisterMap
from acquisition.modbus.requests import BIT_FUNCTIONS
from acquisition.modbus.ring_profile import HEADER, MAGIC, VERSION, RingHeader, Slot
from core.units import NS_PER_S

_DEFAULT_RANGE = (-1000.0, 1000.0)
_OF_CENTURY = 100


class RegisterImage:
    """Contents of the registers and bits of a register map; other addresses do not exist.

    `ranges` contains minimum and maximum by value id, for values whose full scale is stored in
    registers; -1000 and 1000 by default.
    """

    def __init__(
        self, registers: RegisterMap, ranges: Mapping[str, tuple[float, float]] | None = None
    ) -> None:
        self._map, self._base = registers, registers.base
        self._ranges = ranges or {}
        self._words: dict[tuple[int, int], int] = {}
        self._bits: dict[tuple[int, int], bool] = {}
        for cell in registers.cells():
            self._create(cell.function, cell.start(self._base), cell.stop(self._base))
        for block in registers.together:
            start = block.address - self._base
            self._create(block.function, start, start + block.count)
        for signature in registers.signature:
            cell = signature.cell
            self._create(cell.function, cell.start(self._base), cell.stop(self._base))
            self.put(cell, signature.expected)

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        """Return `count` registers as big-endian words; None if an address does not exist."""
        words = [self._words.get((function, at)) for at in range(address, address + count)]
        found = [word for word in words if word is not None]
        return None if len(found) < count else struct.pack(f">{count}H", *found)

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:
        """Return `count` bits packed in bytes, low bit first; None if an address does not exist."""
        bits = [self._bits.get((function, at)) for at in range(address, address + count)]
        found = [bit for bit in bits if bit is not None]
        return None if len(found) < count else np.packbits(found, bitorder="little").tobytes()

    def put(self, cell: Cell, number: float) -> None:
        """Write a raw number to a cell; for an integer type, round it and clip it to the range."""
        start = cell.start(self._base)
        if cell.function in BIT_FUNCTIONS:
            self._bits[cell.function, start] = bool(number)
        elif cell.bit is not None:
            self.put_bits(cell, 1 << cell.bit, bool(number))
        else:
            data = encoded(number, cell)
            for n in range(cell.n_places):
                word = int.from_bytes(data[2 * n : 2 * n + 2], "big")
                self._words[cell.function, start + n] = word

    def put_bits(self, cell: Cell, mask: int, are_set: bool) -> None:
        """Set or clear the bits of `mask` in a register; other bits are unchanged."""
        place = (cell.function, cell.start(self._base))
        if cell.byte_order.low_byte_first:
            mask = (mask & 0xFF) << 8 | mask >> 8
        word = self._words[place]
        self._words[place] = word | mask if are_set else word & ~mask

    def put_value(self, value: MapValue, number: float) -> None:
        """Write a number in the unit of a value; NaN or infinity is written as a missing value."""
        wanted = (number - value.offset) / value.scale
        if value.scale_register is not None:
            scale = max(1.0, math.ceil(abs(wanted))) if math.isfinite(wanted) else 1.0
            self.put(value.scale_register.cell, scale)
            wanted = wanted / scale * value.scale_register.divisor
        elif value.full_scale is not None:
            span = value.full_scale
            default = self._ranges.get(value.id, _DEFAULT_RANGE)
            ends = []
            for end, own in zip((span.minimum, span.maximum), default, strict=True):
                if isinstance(end, Cell):
                    self.put(end, own)
                ends.append(own if isinstance(end, Cell) else end)
            share = (wanted - ends[0]) / (ends[1] - ends[0])
            share = min(max(share, 0.0), 1.0) if math.isfinite(share) else share
            wanted = span.raw_minimum + share * (span.raw_maximum - span.raw_minimum)
        self.put(value.cell, wanted if math.isfinite(wanted) else no_value(value))

    def put_flag(self, flag: FlagCheck, good: bool) -> None:
        """Write the status of a value, good or bad, to its status register."""
        is_bit = flag.cell.type is NumberType.BIT
        if flag.set_means is not None:
            is_set = good is (flag.set_means is Meaning.OK)
            if is_bit:
                self.put(flag.cell, is_set)
            else:
                self.put_bits(flag.cell, flag.mask, is_set)
            return
        taken = {*flag.ok_values, *flag.clipped_values}
        bad_number = next(n for n in range(len(taken) + 1) if n not in taken)
        number = flag.ok_values[0] if good else bad_number
        if is_bit:
            self.put(flag.cell, number)
            return
        self.put_bits(flag.cell, flag.mask, False)
        self.put_bits(flag.cell, number * flag.lowest_bit & flag.mask, True)

    def put_time(self, time_ns: int) -> None:
        """Write the measurement time, in ns since 1970 UTC, if the map has registers for it."""
        time = self._map.time
        if time is None:
            return
        cells = list(time.cells())
        if isinstance(time, EpochTime):
            seconds, rest_ns = divmod(time_ns, NS_PER_S)
            self.put(cells[0], seconds)
            for cell in cells[1:]:
                self.put(cell, int(rest_ns * time.parts_per_s / NS_PER_S))
            return
        utc = datetime.fromtimestamp(time_ns // NS_PER_S + time.utc_offset_s, UTC)
        for cell, name in zip(cells, time.fields, strict=True):
            self.put(cell, getattr(utc, name) % (_OF_CENTURY if name == "year" else 1 << 16))

    def _create(self, function: int, start: int, stop: int) -> None:
        for at in range(start, stop):
            if function in BIT_FUNCTIONS:
                self._bits.setdefault((function, at), False)
            else:
                self._words.setdefault((function, at), 0)


def encoded(number: float, cell: Cell) -> bytes:
    """Return a number as register bytes of a cell; integers are rounded and limited to the type."""
    dtype = np.dtype(DTYPES[cell.type])
    if cell.type not in FLOATS:
        limits = np.iinfo(dtype)
        number = min(max(round(number), int(limits.min)), int(limits.max))
    straight = np.array(number, dtype).tobytes()
    placed = bytearray(N_BYTES[cell.type])
    for byte, place in zip(straight, byte_permutation(cell.type, cell.byte_order), strict=True):
        placed[place] = byte
    return bytes(placed)


def no_value(value: MapValue) -> float:
    """Return the raw number that marks a missing value; zero if the map defines none."""
    if value.cell.type in FLOATS:
        return math.nan
    if value.invalid_values:
        sentinel, modulus = int(value.invalid_values[0]), 1 << 8 * N_BYTES[value.cell.type]
        is_signed = DTYPES[value.cell.type][1] == "i"
        number = sentinel % modulus
        return number - modulus if is_signed and number >= modulus // 2 else number
    if math.isfinite(value.invalid_below):
        return value.invalid_below - 1.0
    return value.invalid_above + 1.0 if math.isfinite(value.invalid_above) else 0.0


def encode_header(header: RingHeader) -> bytes:
    """Return the header of a block ring as big-endian bytes that end with its checksum.

    The values of the slow channels, which follow the header in the device, are not included.
    """
    ring = header.layout
    data = HEADER.pack(
        *(MAGIC, VERSION, ring.n_channels, ring.samples_per_slot, ring.n_slots),
        *(ring.rate_mhz, header.epoch, header.newest),
        *(ring.n_slow, ring.ring_address, ring.slot_stride),
    )
    return data + zlib.crc32(data).to_bytes(4, "big")


def encode_slot(slot: Slot) -> bytes:
    """Return one slot of a block ring as big-endian bytes that end with its checksum."""
    head = struct.pack(
        ">6I",
        *(slot.sequence, slot.first_index, slot.seconds, slot.microseconds),
        *(slot.ok_bits, slot.epoch),
    )
    samples = slot.counts.astype(">i2").tobytes() + slot.trailer.to_bytes(2, "big")
    data = head + encode_slow(slot.slow) + samples
    return data + (zlib.crc32(data) ^ slot.damage).to_bytes(4, "big")


def encode_slow(values: Sequence[float]) -> bytes:
    """Return slow values as big-endian float32 numbers, two registers each."""
    return np.asarray(values, dtype=">f4").tobytes()
