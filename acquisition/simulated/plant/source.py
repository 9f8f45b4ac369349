"""`SimulatedSource`: a sample feed as a sample source, without a wire."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager

from acquisition.clock import Clock
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.calibration import UnitCalibration
from acquisition.simulated.feed import SampleFeed
from core.samples.blocks import SampleBlock

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
            raw = self._feed.advance(self._block_samples)
            self._n_taken += self._block_samples
            due_s = self._n_taken / self._rate_hz if self._paced else 0.0
            await self._clock.sleep(max(0.0, due_s - self._elapsed_s()))
            for block in self._delivery.take(raw):
                yield block

    async def _skip_to(self, index: int) -> None:
        while self._n_taken < index:
            n_samples = min(SKIP_SAMPLES, index - self._n_taken)
            self._feed.advance(n_samples)
            self._n_taken += n_samples
            await self._clock.sleep(0.0)

    def _elapsed_s(self) -> float:
        return self._clock.monotonic_s() - (self._start_s or 0.0)
