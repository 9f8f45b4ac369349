"""`Slot`: the registers of one slot of a block ring, and back; see `profile` for their order."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.modbus.ring_layout import RingLayout
from core.arrays import CountArray
from core.units import NS_PER_S

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
