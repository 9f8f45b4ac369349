"""Blocks on their way from acquisition to analysis: bounded and counted."""

import asyncio
from collections.abc import AsyncIterator

from core.blocks import SampleBlock


class Bus:
    """A queue of sample blocks within one process.

    A full bus makes publishers wait: a device's own ring then buffers, and should it overrun, the
    sample index shows the exact gap. Nothing is dropped here.

    Parameters
    ----------
    capacity
        Most blocks that wait.
    """

    def __init__(self, capacity: int) -> None:
        self._queue: asyncio.Queue[SampleBlock] = asyncio.Queue(capacity)
        self.capacity = capacity
        self.n_published = 0

    @property
    def depth(self) -> int:
        """Blocks waiting now."""
        return self._queue.qsize()

    async def publish(self, block: SampleBlock) -> None:
        """Hand a block over, waiting while the bus is full."""
        await self._queue.put(block)
        self.n_published += 1

    async def blocks(self) -> AsyncIterator[SampleBlock]:
        """All blocks in the order they were published, for ever."""
        while True:
            yield await self._queue.get()

    def done(self) -> None:
        """Say that the block taken last has been dealt with."""
        self._queue.task_done()

    async def drained(self) -> None:
        """Wait until every published block has been dealt with."""
        await self._queue.join()
