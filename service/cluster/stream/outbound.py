"""Messages that wait for the servers: bounded in bytes, in order for each unit."""

import asyncio
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from acquisition.clock import Clock


@dataclass(frozen=True)
class Outgoing:
    """A message with its id; the id is the same whenever the same message is sent.

    Parameters
    ----------
    is_news
        Whether it tells of a link: of several in a row the last says it all.
    """

    id: str
    payload: bytes
    is_news: bool = False


class Outbound:
    """What is to be published.

    Whoever puts waits while it is full: the device's own ring buffers then, and should that
    overrun, the index of the next block shows the exact gap.

    Parameters
    ----------
    capacity
        Most bytes that wait; a message that is larger waits alone.
    """

    def __init__(self, units: Iterable[str], capacity: int, clock: Clock) -> None:
        self._waiting: dict[str, deque[Outgoing]] = {unit: deque() for unit in units}
        self._news = {unit: asyncio.Event() for unit in self._waiting}
        self._room = asyncio.Condition()
        self._clock, self._last_s = clock, clock.monotonic_s()
        self.capacity = capacity
        self.n_bytes = 0
        self.n_published = 0

    @property
    def n_waiting(self) -> int:
        """Messages that wait now."""
        return sum(len(queue) for queue in self._waiting.values())

    @property
    def behind_s(self) -> float:
        """For how long something has been waiting without anything being published."""
        return self._clock.monotonic_s() - self._last_s if self.n_waiting else 0.0

    async def put(self, unit: str, message: Outgoing) -> None:
        """Queue a message, waiting while there is no room."""
        async with self._room:
            await self._room.wait_for(lambda: self._fits(message))
            self.add(unit, message)

    def add(self, unit: str, message: Outgoing) -> None:
        """Queue a message at once; news of a link take the place of those before them."""
        queue = self._waiting[unit]
        if not self.n_waiting:
            self._last_s = self._clock.monotonic_s()
        if message.is_news and len(queue) > 1 and queue[-1].is_news:  # the first is under way
            self.n_bytes -= len(queue.pop().payload)
        queue.append(message)
        self.n_bytes += len(message.payload)
        self._news[unit].set()

    async def first(self, unit: str) -> Outgoing:
        """Wait for the oldest message of a unit; it stays until it is published."""
        while not self._waiting[unit]:
            self._news[unit].clear()
            await self._news[unit].wait()
        return self._waiting[unit][0]

    async def published(self, unit: str) -> None:
        """Let the oldest message of a unit go: the servers have it."""
        message = self._waiting[unit].popleft()
        self.n_bytes -= len(message.payload)
        self.n_published += 1
        self._last_s = self._clock.monotonic_s()
        async with self._room:
            self._room.notify_all()

    async def published_at_least(self, n_messages: int) -> None:
        """Wait until so many have been published since the start."""
        async with self._room:
            await self._room.wait_for(lambda: self.n_published >= n_messages)

    async def drained(self) -> None:
        """Wait until nothing waits."""
        async with self._room:
            await self._room.wait_for(lambda: not self.n_waiting)

    def _fits(self, message: Outgoing) -> bool:
        return not self.n_waiting or self.n_bytes + len(message.payload) <= self.capacity
