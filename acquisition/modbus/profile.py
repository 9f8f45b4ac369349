"""Block-ring profile v1: how a DAQ lays a ring of sample slots out in Modbus registers.

Register addresses are counted from the header's base, everything is big-endian::

    +0 magic        +1 version      +2 n_channels   +3 samples_per_slot  +4 n_slots
    +5..6 rate mHz  +7..8 epoch     +9..10 newest   +11 n_slow           +12 ring address
    +13 slot stride +14..15 spare   +16... slow values, float32

    slot: sequence u32, first sample u32, seconds u32, microseconds u32, channel OK bits u32,
          int16 samples channel by channel, low word of the sequence again
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from core.arrays import CountArray

MAGIC = 0x5057
VERSION = 1
HEADER_REGISTERS = 16
PROGRESS_OFFSET = 7
PROGRESS_REGISTERS = 4
MAX_CHANNELS = 32
ADDRESS_SPACE = 0x10000
U32 = 1 << 32

_HEADER = struct.Struct(">5H3I3H4x")
_PROGRESS = struct.Struct(">II")
_SLOT_HEAD = struct.Struct(">5I")
_SLOT_HEAD_REGISTERS = _SLOT_HEAD.size // 2
_NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class RingLayout:
    """What stays the same while a device runs.

    Parameters
    ----------
    rate_mhz
        Samples per 1000 s and channel: the rate in millihertz.
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

    @property
    def slot_registers(self) -> int:
        """Registers that one slot fills."""
        return _SLOT_HEAD_REGISTERS + self.n_channels * self.samples_per_slot + 1

    @property
    def end_address(self) -> int:
        """First register address after the ring."""
        return self.ring_address + (self.n_slots - 1) * self.slot_stride + self.slot_registers

    @property
    def slot_duration_s(self) -> float:
        """Time that one slot covers."""
        return self.samples_per_slot * 1000.0 / self.rate_mhz

    def slot_address(self, sequence: int) -> int:
        """Register address at which the slot of this sequence number lies."""
        return self.ring_address + sequence % self.n_slots * self.slot_stride

    def require_possible(self) -> None:
        """Refuse a layout that cannot exist.

        Raises
        ------
        ConfigError
            Naming the field, what was found and what is allowed.
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
                raise ConfigError(
                    f"block ring: {name} is {value}, allowed is {lowest} to {highest}"
                )


@dataclass(frozen=True)
class RingHeader:
    """The head of the ring: its layout and how far the device has come."""

    layout: RingLayout
    epoch: int
    newest: int


@dataclass(frozen=True)
class Slot:
    """One slot as it lies in the ring, numbers as they were found.

    Parameters
    ----------
    ok_bits
        Bit c is the device's verdict on channel c.
    counts
        (n_channels, samples_per_slot)
    trailer
        Low word of the sequence, once more, behind the samples.
    """

    sequence: int
    first_index: int
    seconds: int
    microseconds: int
    ok_bits: int
    counts: CountArray
    trailer: int

    @property
    def start_ns(self) -> int:
        """Time of the first sample, UTC nanoseconds since 1970."""
        return self.seconds * _NS_PER_S + self.microseconds * 1000

    @property
    def torn(self) -> bool:
        """Whether head and tail belong to different slots."""
        return self.trailer != self.sequence & 0xFFFF

    @property
    def blank(self) -> bool:
        """Whether nothing has been written here since the device started."""
        return not (self.sequence or self.first_index or self.seconds or self.ok_bits)


def encode_header(header: RingHeader) -> bytes:
    """Header registers, without the slow values."""
    ring = header.layout
    return _HEADER.pack(
        *(MAGIC, VERSION, ring.n_channels, ring.samples_per_slot, ring.n_slots, ring.rate_mhz),
        *(header.epoch, header.newest, ring.n_slow, ring.ring_address, ring.slot_stride),
    )


def decode_header(data: bytes) -> RingHeader:
    """Read the first 16 registers of a device.

    Raises
    ------
    ConfigError
        If this is not a block ring of version 1, or one that cannot exist.
    """
    magic, version, n_channels, samples_per_slot, n_slots, rate_mhz, *rest = _HEADER.unpack(data)
    epoch, newest, n_slow, ring_address, slot_stride = rest
    if magic != MAGIC:
        raise ConfigError(f"block ring: magic is {magic:#06x}, expected {MAGIC:#06x}")
    if version != VERSION:
        raise ConfigError(f"block ring: profile version is {version}, expected {VERSION}")
    layout = RingLayout(
        n_channels, samples_per_slot, n_slots, rate_mhz, n_slow, ring_address, slot_stride
    )
    layout.require_possible()
    return RingHeader(layout, epoch, newest)


def decode_progress(data: bytes) -> tuple[int, int]:
    """Epoch and newest sequence from the four registers at ``PROGRESS_OFFSET``."""
    epoch, newest = _PROGRESS.unpack(data)
    return epoch, newest


def encode_slow(values: Sequence[float]) -> bytes:
    """Slow values as registers, NaN where there is none."""
    return np.asarray(values, dtype=">f4").tobytes()


def decode_slow(data: bytes) -> tuple[float, ...]:
    """Slow values from the registers behind the header."""
    return tuple(np.frombuffer(data, dtype=">f4").tolist())


def encode_slot(slot: Slot) -> bytes:
    """Registers of one slot."""
    head = _SLOT_HEAD.pack(
        slot.sequence, slot.first_index, slot.seconds, slot.microseconds, slot.ok_bits
    )
    return head + slot.counts.astype(">i2").tobytes() + slot.trailer.to_bytes(2, "big")


def decode_slot(data: bytes | memoryview, layout: RingLayout) -> Slot:
    """Read one slot; its counts stay big-endian, since they are converted anyway."""
    sequence, first_index, seconds, microseconds, ok_bits = _SLOT_HEAD.unpack_from(data)
    n_counts = layout.n_channels * layout.samples_per_slot
    counts = np.frombuffer(data, ">i2", n_counts, _SLOT_HEAD.size)
    end = 2 * layout.slot_registers
    return Slot(
        sequence=sequence,
        first_index=first_index,
        seconds=seconds,
        microseconds=microseconds,
        ok_bits=ok_bits,
        counts=counts.reshape(layout.n_channels, layout.samples_per_slot),
        trailer=int.from_bytes(data[end - 2 : end], "big"),
    )
