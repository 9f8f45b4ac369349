"""Side values (slow values, OK bits, time stamps) by sample; sample blocks with side values."""

import itertools
import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from operator import itemgetter

import numpy as np

from acquisition.can.frame_sets import Instant
from acquisition.can.plan import (
    EPOCH,
    HOLD,
    MICROSECONDS,
    OK_BITS,
    SECONDS,
    Plan,
    Refusal,
    RefusalCounts,
)
from acquisition.delivery.arrival import HostStamps
from core.arrays import RawArray
from core.samples.blocks import Rejection, SampleBlock, SideValues
from core.units import NS_PER_S

_MAX_ENTRIES = 4096
_US_PER_S = 1_000_000
_START = itemgetter(0)

_Entry = tuple[int, float, int | None]
"""First sample, value, and validity in samples (None if the quantity `HOLD` sets it)."""


class SideTable:
    """Table of the side values of one epoch by quantity and sample index.

    Each value is valid for a limited number of samples; afterwards the quantity has no value.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._entries: dict[str | int, list[_Entry]] = {key: [] for key in plan.quantities}

    def set(self, key: str | int, start: int, value: float, hold: int | None) -> None:
        """Store a value that is valid for `hold` samples from sample `start` on.

        With `hold` None, the quantity `HOLD` at the same sample gives the number. Each quantity
        keeps 4,096 values; a further value deletes the oldest.
        """
        entries = self._entries[key]
        at = bisect_right(entries, start, key=_START)
        replaces = at > 0 and entries[at - 1][0] == start
        entries[at - replaces : at] = [(start, value, hold)]
        if len(entries) > _MAX_ENTRIES:
            del entries[0]

    def forget_before(self, index: int) -> None:
        """Delete the values that were replaced at or before a sample index."""
        for entries in self._entries.values():
            del entries[: max(0, bisect_right(entries, index, key=_START) - 1)]

    def at(self, key: str | int, index: int) -> float | None:
        """Return the value of a quantity at a sample; None without a valid value."""
        entry = self._entry(key, index)
        return None if entry is None or index >= self._stop(entry) else entry[1]

    def cuts(self, first: int, stop: int) -> list[int]:
        """Return the sample indices between `first` and `stop` where a value starts or expires."""
        return sorted({index for index in self._changes(first, stop) if first < index < stop})

    def stamp_ns(self, index: int) -> int | None:
        """Return the UTC time of a sample in ns since 1970; None without a device time stamp.

        The time is extrapolated from the last time stamp up to the sample.
        """
        seconds = self._entries.get(SECONDS, [])
        for start, second, _ in reversed(seconds[: bisect_right(seconds, index, key=_START)]):
            part = self._entry(MICROSECONDS, start)
            if part is not None and part[0] == start and part[1] < _US_PER_S:
                stamp_ns = (int(second) * _US_PER_S + int(part[1])) * 1000
                return stamp_ns + round((index - start) * NS_PER_S / self._plan.rate_hz)
        return None

    def _entry(self, key: str | int, index: int) -> _Entry | None:
        """Return the last entry that starts at or before a sample."""
        entries = self._entries.get(key, [])
        at = bisect_right(entries, index, key=_START)
        return entries[at - 1] if at else None

    def _changes(self, first: int, stop: int) -> Iterator[int]:
        for entries in self._entries.values():
            before = max(0, bisect_right(entries, first, key=_START) - 1)
            for entry in entries[before : bisect_right(entries, stop, key=_START)]:
                yield from (entry[0], self._stop(entry))

    def _stop(self, entry: _Entry) -> int:
        """Return the first sample at which an entry is no longer valid."""
        start, _, hold = entry
        if hold is None:
            other = self._entry(HOLD, start)
            hold = int(other[1]) if other is not None and other[0] == start else 0
        return start + hold


class BlockBuilder:
    """Builder of sample blocks; a block ends where a side value changes.

    The attribute `side` contains the side values of the current epoch.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan, self._stamps = plan, HostStamps(plan.rate_hz)
        self.begin_epoch()

    def begin_epoch(self) -> None:
        """Delete side values and refusal counts at the start of a new epoch."""
        self.side = SideTable(self._plan)
        self._rejected: RefusalCounts = Counter()

    def blocks(self, epoch: int, instants: Sequence[Instant], arrived_ns: int) -> list[SampleBlock]:
        """Return the blocks of sample instants, given in index order and of one epoch.

        `arrived_ns` is the arrival of the last instant, ns since 1970 UTC.
        """
        blocks = []
        if instants:  # the last instant has the smallest delay
            self._stamps.add(epoch, instants[-1].stop_index, arrived_ns)
        for run in _runs(instants):
            first, stop = run[0].index, run[-1].stop_index
            self._rejected.update(run[0].rejected)
            samples = self._samples(run)
            cuts = [first, *self.side.cuts(first, stop), stop]
            for start, end in itertools.pairwise(cuts):
                piece = samples[:, start - first : end - first]
                block = self._block(epoch, start, piece)
                if block is not None:
                    blocks.append(block)
            self.side.forget_before(stop)
        return blocks

    def _block(self, epoch: int, first_index: int, samples: RawArray) -> SampleBlock | None:
        if self._plan.needs_header and self.side.at(EPOCH, first_index) is None:
            self._rejected[Refusal.NO_HEADER] += samples.shape[1]
            return None
        is_stamped = SECONDS in self._plan.quantities
        start_of = self.side.stamp_ns if is_stamped else self._stamps.start_ns
        start_ns = start_of(first_index)
        if start_ns is None:
            self._rejected[Refusal.NO_TIME] += samples.shape[1]
            return None
        calibration = self._plan.calibration
        values = [self.side.at(number, first_index) for number in range(len(calibration.slow))]
        slow = [math.nan if value is None else value for value in values]
        rejected = tuple(Rejection(reason.value, n) for reason, n in self._rejected.items() if n)
        self._rejected.clear()
        return SampleBlock(
            calibration=calibration,
            epoch=epoch,
            first_index=first_index,
            counts=samples,
            side=SideValues.of(start_ns, self._ok(first_index), slow),
            rejected=rejected,
        )

    def _ok(self, index: int) -> list[bool]:
        """Return the OK state of each channel; False without a valid value of the OK bits."""
        bits = int(self.side.at(OK_BITS, index) or 0) if OK_BITS in self._plan.quantities else -1
        return [bool(bits >> c & 1) for c in range(len(self._plan.calibration.channels))]

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
    """Yield runs of consecutive instants without refused samples in between."""
    begins = [
        n
        for n, (before, after) in enumerate(itertools.pairwise(instants), start=1)
        if after.index != before.stop_index or after.rejected
    ]
    for start, stop in itertools.pairwise([0, *begins, len(instants)] if instants else []):
        yield instants[start:stop]
