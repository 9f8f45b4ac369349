"""`RawBlockBuilder`: complete instants and what was said beside them become raw blocks."""

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from acquisition.can.instants import Instant, Refusal, RefusalCounts
from acquisition.can.plan import EPOCH, OK_BITS, SECONDS, Plan
from acquisition.can.tracks import Tracks, ok_flags
from acquisition.delivery.host_stamps import HostStamps
from acquisition.delivery.raw import RawBlock
from core.arrays import RawArray
from core.samples.blocks import Rejection


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
