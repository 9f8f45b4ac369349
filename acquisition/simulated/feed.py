"""Samples without a wire: feeds, a feed as a source, a feed cut into slots, and the ledger."""

import math
from collections import Counter
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from typing import Protocol

from acquisition.clock import Clock
from acquisition.delivery.blocks import MIN_BLOCK_S, BlockAssembler, RawBlock
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration


class FeedEndedError(Exception):
    """A sample feed has ended, as at the end of a recording."""


class SampleFeed(Protocol):
    """Source of samples of a simulated device, as its converter delivers them."""

    def advance(self, n_samples: int) -> RawBlock:
        """Return the next samples.

        A simulated unit returns as many as requested, directly after the previous ones. A recording
        returns fewer before a gap or a restart of the device, and continues behind it.

        Raises
        ------
        FeedEndedError
            If the feed has ended.
        """
        ...


class Ledger:
    """Samples per channel offered by each unit in each epoch, including lost ones."""

    def __init__(self) -> None:
        self._offered: Counter[tuple[str, int]] = Counter()

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Count samples that a device has produced."""
        self._offered[unit, epoch] += n_samples

    def n_samples(self, unit: str, epoch: int | None = None) -> int:
        """Number of samples offered by a unit, in one epoch or in all."""
        return sum(n for (u, e), n in self._offered.items() if u == unit and epoch in (None, e))


class SlotFeed:
    """Feed cut into slots, one slot ahead, so that a device knows the length of a gap.

    A slot begins at a multiple of its length. Samples that fill no slot before a gap, a restart or
    the end of the feed are left out.
    """

    def __init__(self, feed: SampleFeed, samples_per_slot: int) -> None:
        self._feed = feed
        self._samples_per_slot = samples_per_slot
        self._ahead: RawBlock | None = None

    def peek(self) -> RawBlock | None:
        """Return the next slot and keep it; None if the feed has ended."""
        if self._ahead is None:
            try:
                self._ahead = self._next()
            except FeedEndedError:
                return None
        return self._ahead

    def take(self) -> RawBlock | None:
        """Return the next slot; None if the feed has ended."""
        slot = self.peek()
        self._ahead = None
        return slot

    def number(self, slot: RawBlock) -> int:
        """Number of a slot on the grid."""
        return slot.first_index // self._samples_per_slot

    def _next(self) -> RawBlock:
        """Return the next whole slot; a feed ends its pieces at multiples of their length."""
        while True:
            piece = self._feed.advance(self._samples_per_slot)
            if piece.n_samples == self._samples_per_slot:
                return piece


SKIP_SAMPLES = 65536
"""Samples that are produced and discarded before the event loop continues."""


class SimulatedSource:
    """Calibrated blocks of a sample feed, in real time or as fast as the reader takes them.

    In real time the feed runs from the first connection on: samples that pass between connections
    are lost, and the sample index jumps. Unpaced, a new connection continues at the end of the
    previous one.
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
        """Open the link; see :class:`acquisition.source.SampleSource`."""
        if self._start_s is None:
            self._start_s = self._clock.monotonic_s()
        if self._paced:
            await self._skip_to(int(self._elapsed_s() * self._rate_hz))
        async with aclosing(self._blocks()) as blocks:
            yield blocks

    async def _blocks(self) -> AsyncGenerator[SampleBlock]:
        while True:
            raws = [self._feed.advance(self._block_samples) for _ in range(self._n_at_once)]
            self._n_taken += self._n_at_once * self._block_samples
            due_s = self._n_taken / self._rate_hz if self._paced else 0.0
            await self._clock.sleep(max(0.0, due_s - self._elapsed_s()))
            for block in self._delivery.take_together(raws):
                yield block

    async def _skip_to(self, index: int) -> None:
        while self._n_taken < index:
            n_samples = min(SKIP_SAMPLES, index - self._n_taken)
            self._feed.advance(n_samples)
            self._n_taken += n_samples
            await self._clock.sleep(0.0)

    def _elapsed_s(self) -> float:
        return self._clock.monotonic_s() - (self._start_s or 0.0)
