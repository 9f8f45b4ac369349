"""Layout of FIFO queues, and assembly of their readings on one sample axis of all channels."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from acquisition.delivery.arrival import LeastDelay
from acquisition.errors import LinkError
from acquisition.modbus.requests import MAX_FIFO_REGISTERS
from core.arrays import CountArray
from core.samples.axis import ClockTolerance, Epochs, SampleAxis, signed_distance
from core.units import ns_from_s


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
        (n_samples,) counter of each sample, modulo 65536; unused if the device has no counter.
    counts
        (n_channels, n_samples) int16 counts; n_channels is 1 for the queue of one channel.
    """

    counters: npt.NDArray[np.uint16]
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
            numbers = np.arange(words[1:].size, dtype=np.uint16)
            return FifoPiece(words[:1] + numbers, words[1:].view(np.int16)[np.newaxis])
        if words.size % self.record_registers:
            raise LinkError(
                f"FIFO: {words.size} registers are not whole records of {self.record_registers}"
                " registers; check channels and counter"
            )
        records = words.reshape(-1, self.record_registers)
        samples = records[:, int(self.has_counter) :].view(np.int16)
        return FifoPiece(records[:, 0], np.ascontiguousarray(samples.T))


WRAP = 1 << 16
"""Number of samples after which the 16-bit counter of a queue wraps to 0."""

_TOLERANCE = ClockTolerance(step_s=0.5)
"""Largest difference between a device's sample count and the host's clock: half a second."""

_MAX_REPEATED = 31
"""Maximum number of samples read again from a queue, if reading does not remove samples."""

_MAX_DRIFT = 1e-3
"""Relative error by which the rate of a device without counter may be too low."""

_MAX_EPOCHS = 2

_MAX_APART = 1024
"""Maximum difference of the counters of two queues, in samples; the queues are read in turn."""


@dataclass(frozen=True)
class SamplePlace:
    """Epoch and index of one sample."""

    epoch: int
    index: int


@dataclass(frozen=True)
class PlacedSamples:
    """Consecutive samples of all channels, with epoch and index of the first sample.

    `counts` are (n_channels, n_samples) int16 counts.
    """

    epoch: int
    first_index: int
    counts: CountArray

    @property
    def stop_index(self) -> int:
        """Index after the last sample."""
        return self.first_index + int(self.counts.shape[1])


class CountedSamples:
    """Converter of a 16-bit sample counter to sample indices, also across connections.

    The host's clock shows how often the counter has wrapped. A counter jump that matches the time
    since the last sample is a gap of exactly known length. Any other jump starts a new epoch: the
    device has restarted its counter, or has stopped sampling for a while.

    `removes` is whether reading removes samples; if not, repeated samples are dropped.
    """

    def __init__(self, rate_hz: float, epochs: Epochs, *, removes: bool) -> None:
        self._axis = SampleAxis(rate_hz, epochs)
        self._removes = removes
        self._drained_ns = 0

    def note_drained(self, now_s: float) -> None:
        """Record that the queue was empty at `now_s`: samples read later were measured after it."""
        self._drained_ns = ns_from_s(now_s)

    def is_ambiguous(self, now_s: float) -> bool:
        """Return whether the counter may have advanced by half its period since the last sample.

        Samples in the queue are then of unknown age, and must be discarded.
        """
        axis, now_ns = self._axis, ns_from_s(now_s)
        limit = WRAP / 2 - axis.allowance(now_ns, _TOLERANCE)
        return axis.index is not None and axis.elapsed(now_ns) >= limit

    def place(self, counter: int, now_s: float) -> SamplePlace | None:
        """Return epoch and index of a sample by its counter; None if it was read before.

        `now_s` is the monotonic time of the reading.
        """
        axis, now_ns = self._axis, ns_from_s(now_s)
        if axis.index is None:
            return self._put(counter, now_ns)
        if not self._removes and axis.forward(counter, WRAP) >= WRAP - _MAX_REPEATED:
            return None
        jump, allowance = axis.jump(counter, WRAP, now_ns), axis.allowance(now_ns, _TOLERANCE)
        expected = axis.elapsed(now_ns)
        least = axis.elapsed(self._drained_ns) - allowance
        is_fresh = expected < WRAP / 2 or jump >= expected - allowance
        if not least <= jump <= expected + allowance or not is_fresh:
            axis.epochs.begin()
            return self._put(counter, now_ns)
        return self._put(axis.index + jump, now_ns)

    def runs(self, piece: FifoPiece, now_s: float) -> list[PlacedSamples]:
        """Return the samples of one reading of a queue as runs of consecutive sample indices.

        Samples that were read before are left out. `now_s` is the monotonic time of the reading.

        Raises LinkError if the counter restarts more than once in a reading, so that it cannot
        count samples.
        """
        places = [self.place(counter, now_s) for counter in piece.counters.tolist()]
        if len({place.epoch for place in places if place is not None}) > _MAX_EPOCHS:
            raise LinkError(
                "FIFO: the sample counter restarts repeatedly in one read; check the queue address"
            )
        return list(_joined(places, piece.counts))

    def _put(self, index: int, now_ns: int) -> SamplePlace:
        self._axis.stand_at(index + 1, now_ns)
        return SamplePlace(self._axis.epoch, index)


class UncountedSamples:
    """Counter of the samples received from a device without counter; a loss starts a new epoch.

    Losses are detected by the host's clock alone: the number of missing samples is unknown, so no
    samples are joined across a loss. A loss shorter than the tolerance is not detected.

    `tolerance_s` is the shortest detectable loss; longer than the jitter of polls and replies.
    """

    def __init__(self, rate_hz: float, epochs: Epochs, *, tolerance_s: float) -> None:
        self._rate_hz, self._tolerance_s = rate_hz, tolerance_s
        self._epochs = epochs
        self._next = 0
        self._delay = LeastDelay(_MAX_DRIFT)

    def begin(self) -> None:
        """Begin a new epoch: on a new connection, or when samples were lost."""
        self._epochs.begin()
        self._next = 0
        self._delay = LeastDelay(_MAX_DRIFT)

    def runs(self, piece: FifoPiece, _now_s: float) -> list[PlacedSamples]:
        """Count the samples of the next reading; return them as one run, or none if it is empty."""
        first, self._next = self._next, self._next + piece.n_samples
        placed = PlacedSamples(self._epochs.number, first, piece.counts)
        return [placed] if piece.n_samples else []

    def has_lost(self, now_s: float) -> bool:
        """Return whether samples were lost; `now_s` is the monotonic time of an empty queue."""
        return self._delay.late_s(now_s - self._next / self._rate_hz, now_s) > self._tolerance_s


def _joined(places: Iterable[SamplePlace | None], counts: CountArray) -> Iterator[PlacedSamples]:
    start, first = 0, None
    for n, place in enumerate([*places, None]):
        if first is not None and place == SamplePlace(first.epoch, first.index + n - start):
            continue
        if first is not None:
            yield PlacedSamples(first.epoch, first.index, counts[:, start:n])
        start, first = n, place


class ChannelAssembly:
    """Aligner of the samples of one queue per channel, by the counter in each queue.

    A sample is held until it has arrived in all channels; a loss in one channel is a gap in all.
    """

    def __init__(self, n_channels: int, samples: CountedSamples) -> None:
        self._samples = samples
        self._epoch = -1
        self._next = self._newest = 0
        self._waiting: list[dict[int, int]] = [{} for _ in range(n_channels)]

    def forget(self) -> None:
        """Drop the held samples, for example on a new connection."""
        for waiting in self._waiting:
            waiting.clear()

    def place(self, pieces: list[FifoPiece], now_s: float) -> list[PlacedSamples]:
        """Add one reading of each queue, in the order of the channels; return the aligned samples.

        `now_s` is the monotonic time of the reading. Raises LinkError if the counters of two
        channels differ too much, as after a restart between the reads.
        """
        first, *others = pieces
        for sample in self._samples.runs(first, now_s):
            if sample.epoch != self._epoch:
                self.forget()
                self._epoch, self._next = sample.epoch, sample.first_index
            self._add(0, sample.first_index, sample.counts[0])
            self._newest = sample.stop_index
        for channel, piece in enumerate(others, start=1):
            self._add_other(channel, piece)
        return self._common()

    def _add_other(self, channel: int, piece: FifoPiece) -> None:
        if not piece.n_samples or self._epoch < 0:
            return
        apart = signed_distance(int(piece.counters[0]), self._newest, WRAP)
        if abs(apart) > _MAX_APART:
            raise LinkError(
                f"FIFO: channels 0 and {channel} are {abs(apart)} samples apart, at most"
                f" {_MAX_APART} are accepted"
            )
        self._add(channel, self._newest + apart, piece.counts[0])

    def _add(self, channel: int, start: int, counts: CountArray) -> None:
        found = enumerate(counts.tolist(), start)
        self._waiting[channel].update((i, count) for i, count in found if i >= self._next)

    def _common(self) -> list[PlacedSamples]:
        """Return the samples that all channels have; drop them and all older samples.

        If a channel delivers no samples, the held samples of the others are limited in number.
        """
        shared = sorted(set.intersection(*map(set, self._waiting)))
        counts = np.array(
            [[waiting[i] for i in shared] for waiting in self._waiting], dtype=np.int16
        )
        newest = max((max(waiting) for waiting in self._waiting if waiting), default=0)
        self._next = shared[-1] + 1 if shared else max(self._next, newest - _MAX_APART)
        self._waiting = [
            {i: count for i, count in waiting.items() if i >= self._next}
            for waiting in self._waiting
        ]
        return list(_joined([SamplePlace(self._epoch, i) for i in shared], counts))
