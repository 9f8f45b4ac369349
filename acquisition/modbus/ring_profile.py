"""Block-ring profile: how a DAQ lays a ring of sample slots out in Modbus registers.

Register addresses are counted from the header's base, everything is big-endian::

    +0 magic        +1 version      +2 n_channels   +3 samples_per_slot  +4 n_slots
    +5..6 rate mHz  +7..8 epoch     +9..10 newest   +11 n_slow           +12 ring address
    +13 slot stride +14..15 CRC-32 of +0 to +13     +16... slow values, float32

    slot: sequence u32, first sample u32, seconds u32, microseconds u32, channel OK bits u32,
          epoch u32, slow values float32,
          int16 samples channel by channel, low word of the sequence again,
          CRC-32 of all before it

The version is 2. The slow values behind the header are there for simple clients, and not used here.
The CRC-32 is that of IEEE 802.3, as `zlib.crc32` has it, over the registers as bytes on the wire.
"""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.transport import ADDRESS_SPACE
from core.arrays import CountArray
from core.units import NS_PER_S

MAX_CHANNELS = 32
U32 = 1 << 32

_HEAD_REGISTERS = 12
_TRAILER_REGISTERS = 1
_CRC_REGISTERS = 2


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
        n_counts = self.n_channels * self.samples_per_slot
        return _HEAD_REGISTERS + 2 * self.n_slow + n_counts + _TRAILER_REGISTERS + _CRC_REGISTERS

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


MAGIC = 0x5057
VERSION = 2
HEADER_REGISTERS = 16

_HEADER = struct.Struct(">5H3I3H")


@dataclass(frozen=True)
class RingHeader:
    """The head of the ring: its layout and how far the device has come."""

    layout: RingLayout
    epoch: int
    newest: int


def encode_header(header: RingHeader) -> bytes:
    """Header registers, without the slow values."""
    ring = header.layout
    data = _HEADER.pack(
        *(MAGIC, VERSION, ring.n_channels, ring.samples_per_slot, ring.n_slots),
        *(ring.rate_mhz, header.epoch, header.newest),
        *(ring.n_slow, ring.ring_address, ring.slot_stride),
    )
    return data + zlib.crc32(data).to_bytes(4, "big")


def decode_header(data: bytes) -> RingHeader:
    """Read the first 16 registers of a device.

    Raises
    ------
    ConfigError
        If this is not a block ring of this version, or one that cannot exist.
    FrameError
        If its checksum says that it was changed on the way or while it was written.
    """
    magic, version, n_channels, samples_per_slot, n_slots, rate_mhz, *rest = _HEADER.unpack_from(
        data
    )
    epoch, newest, n_slow, ring_address, slot_stride = rest
    if magic != MAGIC:
        raise ConfigError(f"block ring: magic is {magic:#06x}, expected {MAGIC:#06x}")
    if version != VERSION:
        raise ConfigError(f"block ring: profile version is {version}, known is {VERSION}")
    found = int.from_bytes(data[_HEADER.size : 2 * HEADER_REGISTERS], "big")
    expected = zlib.crc32(data[: _HEADER.size])
    if found != expected:
        raise FrameError(f"block ring: checksum of the header is {found:#x}, not {expected:#x}")
    layout = RingLayout(
        n_channels, samples_per_slot, n_slots, rate_mhz, n_slow, ring_address, slot_stride
    )
    layout.require_possible()
    return RingHeader(layout, epoch, newest)


_HEAD = struct.Struct(">6I")
_CRC_BYTES = 4


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
    epoch
        The device's epoch when it wrote the slot.
    slow
        Slow values of this slot, NaN where there is none.
    damage
        Found checksum exclusive-or the right one: 0 if they are equal.
    blank
        Whether nothing has been written here since the device started.
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
        """Whether nothing says that the slot was changed, by its writer or on the way."""
        return not self.torn and not self.damage


def encode_slot(slot: Slot) -> bytes:
    """Registers of one slot."""
    head = _HEAD.pack(
        *(slot.sequence, slot.first_index, slot.seconds, slot.microseconds),
        *(slot.ok_bits, slot.epoch),
    )
    samples = slot.counts.astype(">i2").tobytes() + slot.trailer.to_bytes(2, "big")
    data = head + encode_slow(slot.slow) + samples
    return data + (zlib.crc32(data) ^ slot.damage).to_bytes(_CRC_BYTES, "big")


def decode_slot(data: bytes | memoryview, layout: RingLayout) -> Slot:
    """Read one slot; what lies behind it is left alone."""
    data = data[: 2 * layout.slot_registers]
    sequence, first_index, seconds, microseconds, ok_bits, epoch = _HEAD.unpack_from(data)
    at = _HEAD.size + 4 * layout.n_slow
    n_counts = layout.n_channels * layout.samples_per_slot
    counts = np.frombuffer(data, ">i2", n_counts, at).astype(np.int16)
    end = at + 2 * n_counts
    return Slot(
        sequence=sequence,
        first_index=first_index,
        seconds=seconds,
        microseconds=microseconds,
        ok_bits=ok_bits,
        counts=counts.reshape(layout.n_channels, layout.samples_per_slot),
        trailer=int.from_bytes(data[end : end + 2], "big"),
        epoch=epoch,
        slow=decode_slow(data[_HEAD.size : at]),
        damage=_damage(data),
        blank=not any(data),
    )


def encode_slow(values: Sequence[float]) -> bytes:
    """Slow values as registers, NaN where there is none."""
    return np.asarray(values, dtype=">f4").tobytes()


def decode_slow(data: bytes | memoryview) -> tuple[float, ...]:
    """Slow values from their registers."""
    return tuple(np.frombuffer(data, dtype=">f4").tolist())


def _damage(data: bytes | memoryview) -> int:
    return zlib.crc32(data[:-_CRC_BYTES]) ^ int.from_bytes(data[-_CRC_BYTES:], "big")
