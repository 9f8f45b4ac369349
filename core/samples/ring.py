"""Ring of the newest samples of one unit, with an account of those that it does not hold."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from core.quality import NOT_MEASURED, Level, Quality, Reading, mean_reading, worst
from core.samples.blocks import BlockMisfitError, Rejection, SampleBlock
from core.samples.gaps import Gap, SampleAccount, n_missed
from core.units import ns_from_s


@dataclass(frozen=True)
class _Stretch:
    """All of a block but its samples, which lie in the ring."""

    first_index: int
    stop_index: int
    start_ns: int
    rate_hz: float
    channel_quality: tuple[Quality, ...]
    slow: Mapping[str, Reading]

    def overlaps(self, first_index: int, stop_index: int) -> bool:
        return self.n_within(first_index, stop_index) > 0

    def n_within(self, first_index: int, stop_index: int) -> int:
        return min(self.stop_index, stop_index) - max(self.first_index, first_index)


class Ring:
    """Samples addressed by their index; the newest ``capacity`` of one epoch.

    Parameters
    ----------
    capacity
        Samples per channel.
    """

    def __init__(self, n_channels: int, capacity: int) -> None:
        self._samples = np.full((n_channels, capacity), np.nan, dtype=np.float32)
        self._capacity = capacity
        self._stretches: deque[_Stretch] = deque()
        self.contiguous_from = 0
        self._unit = ""
        self.epoch: int | None = None
        self.stop_index = 0
        self._stop_ns = 0
        self.account = SampleAccount()

    def write(self, block: SampleBlock) -> Gap | None:
        """Take a block in; return the gap before it, if there is one.

        Samples that were already taken are dropped and counted, never joined on again; so are
        rejected ones, as far as they are more than the jump in the index.

        Raises
        ------
        BlockMisfitError
            As `require` does.
        """
        self.require(block)
        self._unit = block.unit
        if self.epoch is None:  # what came before padwatch looked was not offered to it
            self.epoch, self.stop_index = block.epoch, block.first_index
            self.contiguous_from = block.first_index
        n_missing = self.n_missing_before(block)
        rejected = tuple(_within(block.rejected, n_missing))
        n_gap = n_missing - sum(rejection.n_samples for rejection in rejected)
        gap = _gap(block, n_missing, n_gap) if n_gap else None
        self.account = self.account.with_lost(gap, rejected)
        if block.epoch != self.epoch:
            self._start_epoch(block.epoch)
        if block.first_index > self.stop_index:
            self.contiguous_from = self.stop_index = block.first_index
        self._take(block)
        return gap

    def require(self, block: SampleBlock) -> None:
        """Refuse a block of another number of channels, with a `BlockMisfitError`."""
        if block.samples.shape[0] != self._samples.shape[0]:
            raise BlockMisfitError(
                f"{block.samples.shape[0]} channels offered to a ring of {self._samples.shape[0]}"
            )

    def n_missing_before(self, block: SampleBlock) -> int:
        """Number of samples missing before this block, lost or rejected."""
        if self.epoch is None:
            return 0
        if block.epoch != self.epoch:
            return n_missed(self._stop_ns, block)
        return max(block.first_index - self.stop_index, 0)

    def holds(self, first_index: int, stop_index: int) -> bool:
        """Whether these samples are all here, without a gap."""
        oldest = max(self.contiguous_from, self.stop_index - self._capacity)
        return oldest <= first_index <= stop_index <= self.stop_index

    def read(self, first_index: int, stop_index: int) -> SampleBlock:
        """Copy a stretch of consecutive samples.

        Each channel has its worst quality within the stretch, each slow channel its mean.

        Raises
        ------
        LookupError
            If any of them is not held, or if none are asked for.
        """
        if first_index == stop_index or not self.holds(first_index, stop_index):
            raise LookupError(f"samples {first_index} to {stop_index} are not in the ring")
        where = np.arange(first_index, stop_index) % self._capacity
        stretches = [s for s in self._stretches if s.overlaps(first_index, stop_index)]
        n_samples = [s.n_within(first_index, stop_index) for s in stretches]
        reference = stretches[0]
        offset_s = (first_index - reference.first_index) / reference.rate_hz
        return SampleBlock(
            unit=self._unit,
            epoch=self.epoch or 0,
            first_index=first_index,
            start_ns=reference.start_ns + ns_from_s(offset_s),
            rate_hz=reference.rate_hz,
            samples=self._samples[:, where],
            channel_quality=tuple(
                worst(qualities)
                for qualities in zip(*(s.channel_quality for s in stretches), strict=True)
            ),
            slow={
                id_: mean_reading([s.slow.get(id_, NOT_MEASURED) for s in stretches], n_samples)
                for id_ in reference.slow
            },
        )

    def _start_epoch(self, epoch: int) -> None:
        self._stretches.clear()
        self.epoch, self.stop_index, self.contiguous_from = epoch, 0, 0
        self.account = replace(self.account, n_restarts=self.account.n_restarts + 1)

    def _take(self, block: SampleBlock) -> None:
        n_repeated = min(self.stop_index - block.first_index, block.n_samples)
        fresh = block.from_sample(n_repeated)
        good = all(quality.level is Level.GOOD for quality in block.channel_quality)
        self.account = self.account.with_taken(fresh.n_samples, n_repeated, good=good)
        if fresh.n_samples == 0:
            return
        newest = fresh.samples[:, -self._capacity :]
        where = np.arange(fresh.stop_index - newest.shape[1], fresh.stop_index) % self._capacity
        self._samples[:, where] = newest
        self._stretches.append(
            _Stretch(
                first_index=fresh.first_index,
                stop_index=fresh.stop_index,
                start_ns=fresh.start_ns,
                rate_hz=fresh.rate_hz,
                channel_quality=fresh.channel_quality,
                slow=fresh.slow,
            )
        )
        self.stop_index, self._stop_ns = fresh.stop_index, fresh.stop_ns
        while self._stretches[0].stop_index <= self.stop_index - self._capacity:
            self._stretches.popleft()


def _within(rejected: Iterable[Rejection], n_most: int) -> Iterator[Rejection]:
    """What of these samples can have been offered in a jump; the rest was offered before."""
    for rejection in rejected:
        n_samples = max(0, min(rejection.n_samples, n_most))
        n_most -= n_samples
        if n_samples:
            yield replace(rejection, n_samples=n_samples)


def _gap(block: SampleBlock, n_missing: int, n_samples: int) -> Gap:
    return Gap(block.epoch, block.first_index - n_missing, n_samples, block.start_ns)
