"""`FifoLayout`: arrangement of samples in a device's FIFO queues (function 0x18)."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from acquisition.errors import LinkError
from acquisition.modbus.requests import MAX_FIFO_REGISTERS
from core.arrays import CountArray


class FifoKind(StrEnum):
    """Kind of queue: one interleaved queue for all channels, or one queue per channel."""

    INTERLEAVED = "interleaved"
    PER_CHANNEL = "per_channel"


@dataclass(frozen=True)
class FifoPiece:
    """Decoded samples from one reading of a queue.

    Parameters
    ----------
    counters
        (n_samples,) counter of each sample, modulo 65536; None if the device has no counter.
    counts
        (n_channels, n_samples) int16 counts; n_channels is 1 for the queue of one channel.
    """

    counters: npt.NDArray[np.int64] | None
    counts: CountArray

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return int(self.counts.shape[1])


@dataclass(frozen=True, kw_only=True)
class FifoLayout:
    """Addresses of the queues and format of their records.

    A record of an interleaved queue is a sample counter, if the device has one, and one sample of
    each channel. A queue of one channel holds the counter of its first sample, then samples.

    Parameters
    ----------
    addresses
        Address of the queue, or of the queue of each channel; counted from 0 as on the wire.
    has_counter
        Whether records carry an unsigned 16-bit counter that increases by 1 per sample.
    removes
        Whether reading removes the samples from the queue; depends on the device.
    """

    addresses: tuple[int, ...]
    n_channels: int
    kind: FifoKind = FifoKind.INTERLEAVED
    has_counter: bool = True
    removes: bool = True

    @property
    def record_registers(self) -> int:
        """Number of registers in a record: those of the samples, and of the counter if any."""
        n_samples = self.n_channels if self.kind is FifoKind.INTERLEAVED else 1
        return n_samples + self.has_counter

    @property
    def most_samples(self) -> int:
        """Maximum number of samples per channel in one reading."""
        if self.kind is FifoKind.INTERLEAVED:
            return MAX_FIFO_REGISTERS // self.record_registers
        return MAX_FIFO_REGISTERS - 1

    def decode(self, data: bytes) -> FifoPiece:
        """Return the samples in one reading of one queue.

        Raises LinkError if the reading contains an incomplete record.
        """
        words = np.frombuffer(data, ">u2").astype(np.uint16)
        if self.kind is FifoKind.PER_CHANNEL:
            return self._decode_channel(words)
        if words.size % self.record_registers:
            raise LinkError(
                f"FIFO: {words.size} registers are not whole records of {self.record_registers}"
                " registers; check channels and counter"
            )
        records = words.reshape(-1, self.record_registers)
        counters = records[:, 0].astype(np.int64) if self.has_counter else None
        samples = records[:, int(self.has_counter) :].view(np.int16)
        return FifoPiece(counters, np.ascontiguousarray(samples.T))

    def _decode_channel(self, words: npt.NDArray[np.uint16]) -> FifoPiece:
        samples = words[1:].view(np.int16)[np.newaxis]
        first = int(words[0]) if words.size else 0
        return FifoPiece((first + np.arange(samples.shape[1])) % 65536, samples)
