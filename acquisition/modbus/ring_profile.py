"""Block-ring profile: layout of a ring of sample slots in the Modbus registers of a DAQ.

Register addresses are relative to the base address of the header; byte order is big-endian::

    +0 magic        +1 version      +2 n_channels   +3 samples_per_slot  +4 n_slots
    +5..6 rate mHz  +7..8 epoch     +9..10 newest   +11 n_slow           +12 ring address
    +13 slot stride +14..15 CRC-32 of +0 to +13     +16... slow values, float32

    slot: sequence u32, first sample u32, seconds u32, microseconds u32, channel OK bits u32,
          epoch u32, slow values float32,
          int16 samples channel by channel, low word of the sequence again,
          CRC-32 of all before it

The version is 2. The slow values after the header are for simple clients, and not used here.
The CRC-32 is that of IEEE 802.3 (`zlib.crc32`), computed over the register bytes on the wire.
"""

import struct
import zlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.requests import ADDRESS_SPACE
from core.arrays import CountArray
from core.units import NS_PER_S

MAGIC = 0x5057
VERSION = 2
HEADER_REGISTERS = 16
MAX_CHANNELS = 32
U32 = 1 << 32

HEADER = struct.Struct(">5H3I3H")
"""Fields of the header before its checksum."""

_HEAD_REGISTERS, _TRAILER_REGISTERS, _CRC_REGISTERS = 12, 1, 2


@dataclass(frozen=True)
class RingLayout:
    """Dimensions and addresses of a ring; constant while a device runs.

    Parameters
    ----------
    rate_mhz
        Sampling rate per channel in millihertz.
    ring_address
        Register address of the first slot.
    slot_stride
        Registers from the start of one slot to the start of the next.
    """

    n_channels: int
    samples_per_slot: int
    n_slots: int
    rate_mhz: int
    n_slow: int
    ring_address: int
    slot_stride: int

    @cached_property
    def slot_type(self) -> np.dtype[Any]:
        """Structured numpy dtype of one slot; `require_possible` must be called first."""
        return np.dtype(
            [
                ("head", ">u4", (6,)),
                ("slow", ">f4", (self.n_slow,)),
                ("counts", ">i2", (self.n_channels, self.samples_per_slot)),
                ("trailer", ">u2"),
                ("crc", ">u4"),
            ]
        )

    @property
    def slot_registers(self) -> int:
        """Number of registers of one slot."""
        n_counts = self.n_channels * self.samples_per_slot
        return _HEAD_REGISTERS + 2 * self.n_slow + n_counts + _TRAILER_REGISTERS + _CRC_REGISTERS

    @property
    def end_address(self) -> int:
        """Register address after the last register of the ring."""
        return self.ring_address + (self.n_slots - 1) * self.slot_stride + self.slot_registers

    @property
    def slot_duration_s(self) -> float:
        """Duration of the samples in one slot, s."""
        return self.samples_per_slot * 1000.0 / self.rate_mhz

    def slot_address(self, sequence: int) -> int:
        """Return the register address of the slot with a sequence number."""
        return self.ring_address + sequence % self.n_slots * self.slot_stride

    def require_possible(self) -> None:
        """Check that all fields of the layout are within their limits.

        Raises ConfigError if a field is out of its limits; the message contains field, value and
        limits.
        """
        for name, value, lowest, highest in (
            ("n_channels", self.n_channels, 1, MAX_CHANNELS),
            ("samples_per_slot", self.samples_per_slot, 1, ADDRESS_SPACE - 1),
            ("n_slots", self.n_slots, 2, ADDRESS_SPACE - 1),
            ("rate in mHz", self.rate_mhz, 1, U32 - 1),
            ("slot stride", self.slot_stride, self.slot_registers, ADDRESS_SPACE - 1),
            ("end of the ring", self.end_address, 1, ADDRESS_SPACE),
        ):
            if not lowest <= value <= highest:
                raise ConfigError(f"block ring: {name} must be {lowest} to {highest}, got {value}")


@dataclass(frozen=True)
class RingHeader:
    """Header of a ring: layout, epoch of the device, and sequence number of the newest slot.

    A changed epoch means that the device has restarted its counters.
    """

    layout: RingLayout
    epoch: int
    newest: int


def decode_header(data: bytes) -> RingHeader:
    """Decode a header from the contents of its 16 registers.

    Raises
    ------
    ConfigError
        If magic, version or layout are invalid.
    FrameError
        If the checksum is wrong: the header was corrupted in transmission, or being written.
    """
    magic, version, n_channels, samples_per_slot, n_slots, rate_mhz, *rest = HEADER.unpack_from(
        data
    )
    epoch, newest, n_slow, ring_address, slot_stride = rest
    if magic != MAGIC:
        raise ConfigError(f"block ring: magic is {magic:#06x}, expected {MAGIC:#06x}")
    if version != VERSION:
        raise ConfigError(f"block ring: profile version is {version}, expected {VERSION}")
    found = int.from_bytes(data[HEADER.size : 2 * HEADER_REGISTERS], "big")
    expected = zlib.crc32(data[: HEADER.size])
    if found != expected:
        raise FrameError(f"block ring: header checksum is {found:#x}, expected {expected:#x}")
    layout = RingLayout(
        n_channels, samples_per_slot, n_slots, rate_mhz, n_slow, ring_address, slot_stride
    )
    layout.require_possible()
    return RingHeader(layout, epoch, newest)


@dataclass(frozen=True)
class Slot:
    """Slot as decoded; checksum and counters are not checked yet.

    Parameters
    ----------
    sequence
        Sequence number of the slot, modulo 2**32.
    first_index
        Index of the first sample, modulo 2**32.
    ok_bits
        Bit c is set if the device reports channel c as OK.
    counts
        (n_channels, samples_per_slot) int16 counts of the A/D converter.
    trailer
        Low word of the sequence number, repeated after the samples.
    epoch
        Epoch of the device when it wrote the slot.
    slow
        Slow values of this slot; NaN for a missing value.
    damage
        Exclusive-or of the stored and the computed checksum; 0 if they are equal.
    blank
        Whether all registers are 0: the slot has not been written since the device started.
    """

    sequence: int
    first_index: int
    seconds: int
    microseconds: int
    ok_bits: int
    counts: CountArray
    trailer: int
    epoch: int
    slow: tuple[float, ...] = ()
    damage: int = 0
    blank: bool = field(default=False, compare=False)

    @property
    def start_ns(self) -> int:
        """Time of the first sample, UTC nanoseconds since 1970."""
        return self.seconds * NS_PER_S + self.microseconds * 1000

    @property
    def torn(self) -> bool:
        """Whether the slot was being written while it was read."""
        return self.trailer != self.sequence & 0xFFFF

    @property
    def whole(self) -> bool:
        """Whether trailer and checksum are correct."""
        return not self.torn and not self.damage


def decode_slots(content: bytes, layout: RingLayout) -> list[Slot]:
    """Return the slots in the registers of consecutive slots; checksums are not checked."""
    records = np.frombuffer(content, layout.slot_type)
    n_bytes, counts = records.itemsize, records["counts"].astype(np.int16)
    heads, slow, trailers, crcs = (
        records[name].tolist() for name in ("head", "slow", "trailer", "crc")
    )
    slots = []
    for n, (sequence, first_index, seconds, microseconds, ok_bits, epoch) in enumerate(heads):
        data = content[n * n_bytes : (n + 1) * n_bytes]
        slots.append(
            Slot(
                sequence,
                first_index,
                seconds,
                microseconds,
                ok_bits,
                counts[n],
                trailers[n],
                epoch,
                slow=tuple(slow[n]),
                damage=zlib.crc32(data[: -2 * _CRC_REGISTERS]) ^ crcs[n],
                blank=not any(data),
            )
        )
    return slots
