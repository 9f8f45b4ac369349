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
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
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
"""The header up to its checksum."""

_HEAD_REGISTERS, _TRAILER_REGISTERS, _CRC_REGISTERS = 12, 1, 2


@dataclass(frozen=True)
class RingLayout:
    """Shape and place of a ring: what stays the same while a device runs.

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

    @cached_property
    def slot_type(self) -> np.dtype[Any]:
        """Numbers of one slot as they lie in its registers; of a layout that is possible."""
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


@dataclass(frozen=True)
class RingHeader:
    """Header of a ring: its layout, the device's epoch and the sequence of the newest slot."""

    layout: RingLayout
    epoch: int
    newest: int


def decode_header(data: bytes) -> RingHeader:
    """Read the first 16 registers of a device.

    Raises
    ------
    ConfigError
        If this is not a block ring of this version, or one that cannot exist.
    FrameError
        If its checksum says that it was changed on the way or while it was written.
    """
    magic, version, n_channels, samples_per_slot, n_slots, rate_mhz, *rest = HEADER.unpack_from(
        data
    )
    epoch, newest, n_slow, ring_address, slot_stride = rest
    if magic != MAGIC:
        raise ConfigError(f"block ring: magic is {magic:#06x}, expected {MAGIC:#06x}")
    if version != VERSION:
        raise ConfigError(f"block ring: profile version is {version}, known is {VERSION}")
    found = int.from_bytes(data[HEADER.size : 2 * HEADER_REGISTERS], "big")
    expected = zlib.crc32(data[: HEADER.size])
    if found != expected:
        raise FrameError(f"block ring: checksum of the header is {found:#x}, not {expected:#x}")
    layout = _possible_layout(
        n_channels, samples_per_slot, n_slots, rate_mhz, n_slow, ring_address, slot_stride
    )
    return RingHeader(layout, epoch, newest)


@lru_cache(maxsize=256)
def _possible_layout(*fields: int) -> RingLayout:
    """Layout of these fields, checked once for all polls."""
    layout = RingLayout(*fields)
    layout.require_possible()
    return layout


@dataclass(frozen=True)
class Slot:
    """One slot as it was read, unchecked.

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
        """Whether trailer and checksum show no change, by its writer or on the way."""
        return not self.torn and not self.damage


def decode_slots(content: bytes, layout: RingLayout) -> list[Slot]:
    """Read slots that lie one behind the other."""
    records, view = np.frombuffer(content, layout.slot_type), memoryview(content)
    counts, n_bytes = records["counts"].astype(np.int16), records.itemsize
    columns = (records[name].tolist() for name in ("head", "slow", "trailer", "crc"))
    slots = []
    for n, (head, slow, trailer, crc) in enumerate(zip(*columns, strict=True)):
        data = view[n * n_bytes : (n + 1) * n_bytes]
        sequence, first_index, seconds, microseconds, ok_bits, epoch = head
        slots.append(
            Slot(
                sequence,
                first_index,
                seconds,
                microseconds,
                ok_bits,
                counts[n],
                trailer,
                epoch,
                slow=tuple(slow),
                damage=zlib.crc32(data[: -2 * _CRC_REGISTERS]) ^ crc,
                blank=not any(data),
            )
        )
    return slots
