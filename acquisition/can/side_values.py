"""What stands beside the samples and for which of them; blocks of both."""

import itertools
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from acquisition.can.plan import (
    EPOCH,
    HOLD,
    MICROSECONDS,
    OK_BITS,
    SECONDS,
    Instant,
    Plan,
    Refusal,
    RefusalCounts,
)
from acquisition.delivery.arrival import HostStamps
from acquisition.delivery.raw import RawBlock
from core.arrays import RawArray
from core.samples.blocks import Rejection
from core.units import NS_PER_S

_MAX_ENTRIES = 4096
_US_PER_S = 1_000_000


class Track:
    """Values of one quantity, each from a sample on; older ones are forgotten."""

    def __init__(self) -> None:
        self.starts: list[int] = []
        self._values: list[float] = []
        self._holds: list[int | None] = []

    def set(self, start: int, value: float, hold: int | None) -> None:
        """Note a value; None as hold if another quantity tells for how many samples it holds."""
        at = bisect_right(self.starts, start)
        if at and self.starts[at - 1] == start:
            at -= 1
            del self.starts[at], self._values[at], self._holds[at]
        self.starts.insert(at, start)
        self._values.insert(at, value)
        self._holds.insert(at, hold)
        if len(self.starts) > _MAX_ENTRIES:
            self.forget(1)

    def entry(self, index: int) -> tuple[int, float, int | None] | None:
        """Start, value and hold of the newest value that is not newer than a sample."""
        at = bisect_right(self.starts, index) - 1
        return None if at < 0 else (self.starts[at], self._values[at], self._holds[at])

    def forget_before(self, index: int) -> None:
        """Forget what was replaced before a sample."""
        self.forget(bisect_right(self.starts, index) - 1)

    def forget(self, n_entries: int) -> None:
        """Forget the oldest."""
        if n_entries > 0:
            del self.starts[:n_entries], self._values[:n_entries], self._holds[:n_entries]


class Tracks:
    """All quantities beside the waveforms of one epoch.

    An old value never passes for a new one: beyond the samples it was said for there is none.
    """

    def __init__(self, plan: Plan, rate_hz: float) -> None:
        self._plan = plan
        self._rate_hz = rate_hz
        self._tracks = {key: Track() for key in plan.quantities}

    def set(self, key: str | int, start: int, value: float, hold: int | None) -> None:
        """Note what a frame said."""
        self._tracks[key].set(start, value, hold)

    def clear(self) -> None:
        """Forget all, as when the device begins to count anew."""
        self._tracks = {key: Track() for key in self._plan.quantities}

    def forget_before(self, index: int) -> None:
        """Forget what no coming sample can need."""
        for track in self._tracks.values():
            track.forget_before(index)

    def at(self, key: str | int, index: int) -> float | None:
        """Value of a quantity at a sample; None if nothing valid was said."""
        entry = self._tracks[key].entry(index) if key in self._tracks else None
        if entry is None:
            return None
        start, value, hold = entry
        return value if index < self._stop(start, hold) else None

    def cuts(self, first: int, stop: int) -> list[int]:
        """Samples between these at which any quantity begins or ends to hold."""
        return sorted({index for index in self._changes(first, stop) if first < index < stop})

    def stamp_ns(self, index: int) -> int | None:
        """Time of a sample by the last stamp before it; None if there is none."""
        if SECONDS not in self._tracks:
            return None
        seconds, microseconds = self._tracks[SECONDS], self._tracks[MICROSECONDS]
        for start in reversed(seconds.starts[: bisect_right(seconds.starts, index)]):
            whole, part = seconds.entry(start), microseconds.entry(start)
            if whole and part and part[0] == start and part[1] < _US_PER_S:
                stamp_ns = (int(whole[1]) * _US_PER_S + int(part[1])) * 1000
                return stamp_ns + round((index - start) * NS_PER_S / self._rate_hz)
        return None

    def _changes(self, first: int, stop: int) -> Iterator[int]:
        for track in self._tracks.values():
            before = max(0, bisect_right(track.starts, first) - 1)
            for start in track.starts[before : bisect_right(track.starts, stop)]:
                entry = track.entry(start)
                yield start
                if entry is not None:
                    yield self._stop(start, entry[2])

    def _stop(self, start: int, hold: int | None) -> int:
        if hold is not None:
            return start + hold
        entry = self._tracks[HOLD].entry(start)
        told = entry is not None and entry[0] == start
        return start + int(entry[1]) if told and entry is not None else start


def ok_flags(bits: float | None, told: bool, n_channels: int) -> tuple[bool, ...]:
    """The device's verdict on each channel; a channel is OK only as long as the device says so."""
    if not told:
        return (True,) * n_channels
    return tuple(bits is not None and bool(int(bits) >> c & 1) for c in range(n_channels))


class RawBlockBuilder:
    """Cuts runs of samples wherever anything changes that a block has only one of.

    Attributes
    ----------
    tracks
        What the device said beside the samples.
    """

    def __init__(self, plan: Plan, n_channels: int, n_slow: int, rate_hz: float) -> None:
        self._plan = plan
        self._n_channels = n_channels
        self._n_slow = n_slow
        self._rate_hz = rate_hz
        self._needs_header = any(
            part.epoch and part.counter and part.wave is None
            for message in plan.messages.values()
            for part in message.parts.values()
        )
        self.tracks = Tracks(plan, rate_hz)
        self._stamps = HostStamps(rate_hz)
        self._rejected: RefusalCounts = Counter()

    def begin_epoch(self) -> None:
        """Forget what was said and refused in the epoch that has ended."""
        self.tracks.clear()
        self._rejected.clear()

    def blocks(self, instants: Sequence[Instant], arrived_ns: int) -> list[RawBlock]:
        """Build blocks of instants of one epoch, in index order, which had come by then."""
        blocks = []
        if instants:  # the last one has waited least
            self._stamps.add(instants[-1].epoch, instants[-1].stop_index, arrived_ns)
        for run in _runs(instants):
            first, stop = run[0].index, run[-1].stop_index
            self._rejected.update(run[0].rejected)
            samples = self._samples(run)
            cuts = [first, *self.tracks.cuts(first, stop), stop]
            for start, end in itertools.pairwise(cuts):
                piece = samples[:, start - first : end - first]
                block = self._block(run[0].epoch, start, piece)
                if block is not None:
                    blocks.append(block)
            self.tracks.forget_before(stop)
        return blocks

    def _block(self, epoch: int, first_index: int, samples: RawArray) -> RawBlock | None:
        start_ns = self._start_ns(first_index)
        if self._needs_header and self.tracks.at(EPOCH, first_index) is None:
            self._rejected[Refusal.NO_HEADER] += samples.shape[1]
            return None
        if start_ns is None:
            self._rejected[Refusal.NO_TIME] += samples.shape[1]
            return None
        told = [self.tracks.at(number, first_index) for number in range(self._n_slow)]
        ok_bits = self.tracks.at(OK_BITS, first_index)
        rejected = tuple(Rejection(reason.value, n) for reason, n in self._rejected.items() if n)
        self._rejected.clear()
        return RawBlock(
            epoch=epoch,
            first_index=first_index,
            start_ns=start_ns,
            rate_hz=self._rate_hz,
            counts=samples,
            ok=ok_flags(ok_bits, OK_BITS in self._plan.quantities, self._n_channels),
            slow=tuple(np.nan if value is None else value for value in told),
            rejected=rejected,
        )

    def _start_ns(self, index: int) -> int | None:
        if SECONDS in self._plan.quantities:
            return self.tracks.stamp_ns(index)
        return self._stamps.start_ns(index)

    def _samples(self, run: Sequence[Instant]) -> RawArray:
        frames = list(zip(*(instant.frames for instant in run), strict=True))
        samples = self._plan.decoder.samples(frames)
        n_per_frame = self._plan.samples_per_frame
        n_valid = np.array([instant.n_samples for instant in run])
        if (n_valid == n_per_frame).all():
            return samples
        valid = np.arange(n_per_frame) < n_valid[:, np.newaxis]
        return samples[:, valid.ravel()]


def _runs(instants: Sequence[Instant]) -> Iterator[Sequence[Instant]]:
    """Instants that follow each other, with nothing refused in between."""
    start = 0
    for n in range(1, len(instants) + 1):
        if n == len(instants) or not _continues(instants[n - 1], instants[n]):
            yield instants[start:n]
            start = n


def _continues(before: Instant, after: Instant) -> bool:
    return after.index == before.stop_index and after.epoch == before.epoch and not after.rejected
