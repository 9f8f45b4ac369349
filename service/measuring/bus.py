"""Blocks on their way from acquisition to analysis: bounded and counted."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator

from acquisition.clock import Clock
from core.samples.blocks import SampleBlock


class Bus:
    """A queue of sample blocks within one process.

    A full bus makes publishers wait: a device's own ring then buffers, and should it overrun, the
    sample index shows the exact gap. Nothing is dropped here.

    Parameters
    ----------
    capacity
        Most blocks that wait.
    """

    def __init__(self, capacity: int, clock: Clock) -> None:
        self._queue: asyncio.Queue[SampleBlock] = asyncio.Queue(capacity)
        self._clock = clock
        self._published_s: deque[float] = deque()
        self.capacity = capacity
        self.n_published = 0

    @property
    def depth(self) -> int:
        """Blocks waiting now."""
        return self._queue.qsize()

    @property
    def oldest_wait_s(self) -> float:
        """For how long the oldest block that is not dealt with has been here."""
        if not self._published_s:
            return 0.0
        return self._clock.monotonic_s() - self._published_s[0]

    async def publish(self, block: SampleBlock) -> None:
        """Hand a block over, waiting while the bus is full."""
        await self._queue.put(block)
        self._published_s.append(self._clock.monotonic_s())
        self.n_published += 1

    async def blocks(self) -> AsyncIterator[SampleBlock]:
        """All blocks in the order they were published, for ever."""
        while True:
            yield await self._queue.get()

    def done(self) -> None:
        """Say that the block taken last has been dealt with."""
        self._queue.task_done()
        self._published_s.popleft()

    async def drained(self) -> None:
        """Wait until every published block has been dealt with."""
        await self._queue.join()
