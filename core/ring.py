"""The ring of the newest samples of one unit, which knows what it does not hold."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from core.account import Gap, SampleAccount
from core.blocks import SampleBlock
from core.quality import Level, Quality, Reading, mean_reading, worst
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
        self.account = SampleAccount()

    def write(self, block: SampleBlock) -> Gap | None:
        """Take a block in; return the gap before it, if there is one.

        Samples that were already taken are dropped and counted, never joined on again.

        Raises
        ------
        ValueError
            If the block has another number of channels than the ring, or names more rejected
            samples than the jump in the index leaves room for.
        """
        if block.samples.shape[0] != self._samples.shape[0]:
            raise ValueError(
                f"{block.samples.shape[0]} channels offered to a ring of {self._samples.shape[0]}"
            )
        self._unit = block.unit
        if self.epoch is None:  # what came before padwatch looked was not offered to it
            block = replace(block, rejected=())
            self.epoch, self.stop_index = block.epoch, block.first_index
            self.contiguous_from = block.first_index
        gap = self._gap_before(block)
        self.account = self.account.with_lost(gap, block.rejected)
        if block.epoch != self.epoch:
            self._start_epoch(block.epoch)
        if block.first_index > self.stop_index:
            self.contiguous_from = self.stop_index = block.first_index
        self._take(block)
        return gap

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
                id_: mean_reading([s.slow[id_] for s in stretches], n_samples)
                for id_ in reference.slow
            },
        )

    def _gap_before(self, block: SampleBlock) -> Gap | None:
        expected = self.stop_index if block.epoch == self.epoch else 0
        n_missing = max(block.first_index - expected, 0)
        n_rejected = sum(rejection.n_samples for rejection in block.rejected)
        if n_rejected > n_missing:
            raise ValueError(f"{n_rejected} samples rejected in a jump of {n_missing}")
        if n_missing == n_rejected:
            return None
        return Gap(block.epoch, expected, n_missing - n_rejected, block.start_ns)

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
        self.stop_index = fresh.stop_index
        while self._stretches[0].stop_index <= self.stop_index - self._capacity:
            self._stretches.popleft()
