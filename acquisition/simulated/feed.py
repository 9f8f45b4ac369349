"""Sample feeds of simulated devices: protocol, sample counts, slots, simulated source."""

import math
from collections import Counter
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from typing import Protocol

from acquisition.clock import Clock
from acquisition.delivery.blocks import MIN_BLOCK_S, BlockAssembler
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration


class FeedEndedError(Exception):
    """Error raised if a sample feed has ended, for example at the end of a recording."""


class SampleFeed(Protocol):
    """Protocol of the source of sample blocks of a simulated device."""

    def advance(self, n_samples: int) -> SampleBlock:
        """Return the next samples, at most `n_samples`.

        A simulated unit returns exactly `n_samples` consecutive samples. A recording returns fewer
        before a gap or a restart of the device, and continues after it.

        Raises FeedEndedError if the feed has ended.
        """
        ...


class Ledger:
    """Count of samples per channel produced by each unit in each epoch, including lost samples."""

    def __init__(self) -> None:
        self._offered: Counter[tuple[str, int]] = Counter()

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Add produced samples to the count of a unit and an epoch."""
        self._offered[unit, epoch] += n_samples

    def n_samples(self, unit: str, epoch: int | None = None) -> int:
        """Return the number of samples produced by a unit in an epoch; None for all epochs."""
        return sum(n for (u, e), n in self._offered.items() if u == unit and epoch in (None, e))


class SlotFeed:
    """Sample feed divided into slots of equal length, with look-ahead by one slot.

    The sample index of the next slot shows the length of a gap before it. Each slot begins at a
    multiple of its length. Incomplete slots before a gap, a restart or the end are discarded.
    """

    def __init__(self, feed: SampleFeed, samples_per_slot: int) -> None:
        self._feed = feed
        self._samples_per_slot = samples_per_slot
        self._ahead: SampleBlock | None = None

    def peek(self) -> SampleBlock | None:
        """Return the next slot without removing it; None if the feed has ended."""
        if self._ahead is None:
            try:
                self._ahead = self._next()
            except FeedEndedError:
                return None
        return self._ahead

    def take(self) -> SampleBlock | None:
        """Remove and return the next slot; None if the feed has ended."""
        slot = self.peek()
        self._ahead = None
        return slot

    def number(self, slot: SampleBlock) -> int:
        """Return the number of a slot: its first sample index divided by the slot length."""
        return slot.first_index // self._samples_per_slot

    def _next(self) -> SampleBlock:
        """Return the next complete slot; incomplete slots of the feed are discarded."""
        while True:
            piece = self._feed.advance(self._samples_per_slot)
            if piece.n_samples == self._samples_per_slot:
                return piece


SKIP_SAMPLES = 65536
"""Maximum number of samples that are discarded before the event loop runs other tasks."""


class SimulatedSource:
    """Sample source that yields calibrated blocks of a sample feed.

    If `paced`, the feed runs in real time from the first connection. Samples between two
    connections are lost, and the sample index jumps. Otherwise blocks are yielded as fast as
    they are read, and a new connection continues where the previous connection ended.
    """

    def __init__(
        self,
        feed: SampleFeed,
        calibration: UnitCalibration,
        clock: Clock,
        paced: bool = True,
    ) -> None:
        self._feed = feed
        self._rate_hz = calibration.rate_hz
        self._block_samples = calibration.block_samples
        self._n_at_once = math.ceil(MIN_BLOCK_S * calibration.rate_hz / calibration.block_samples)
        self._delivery = BlockAssembler(calibration)
        self._clock = clock
        self._paced = paced
        self._start_s: float | None = None
        self._n_taken = 0

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Start the feed, or continue it, and yield an iterator of its calibrated blocks."""
        if self._start_s is None:
            self._start_s = self._clock.monotonic_s()
        if self._paced:
            await self._skip_to(int(self._elapsed_s() * self._rate_hz))
        async with aclosing(self._blocks()) as blocks:
            yield blocks

    async def _blocks(self) -> AsyncGenerator[SampleBlock]:
        while True:
            pieces = [self._feed.advance(self._block_samples) for _ in range(self._n_at_once)]
            self._n_taken += self._n_at_once * self._block_samples
            due_s = self._n_taken / self._rate_hz if self._paced else 0.0
            await self._clock.sleep(max(0.0, due_s - self._elapsed_s()))
            for block in self._delivery.take(pieces):
                yield block

    async def _skip_to(self, index: int) -> None:
        while self._n_taken < index:
            n_samples = min(SKIP_SAMPLES, index - self._n_taken)
            self._feed.advance(n_samples)
            self._n_taken += n_samples
            await self._clock.sleep(0.0)

    def _elapsed_s(self) -> float:
        return self._clock.monotonic_s() - (self._start_s or 0.0)
