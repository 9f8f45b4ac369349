"""What a poll takes: the time in which a source works between two waits for its next one."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any
from weakref import WeakKeyDictionary

from acquisition.clock import Clock
from acquisition.source import SampleSource, refused_frames_of
from core.samples.blocks import SampleBlock
from service.runtime.durations import Durations
from service.runtime.heartbeats import UNHEARD, Pulse

POLL_BOUNDS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0)
"""A reply comes within milliseconds on a plant's network, and within a time-out at worst."""


class PollClock:
    """A source's clock that notes what the source does between its waits, each task apart.

    Whoever reads the source looks at it again and again, and so is heard of.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pulse: Pulse = UNHEARD
        self._reader: asyncio.Task[Any] | None = None
        self._woken_s: WeakKeyDictionary[asyncio.Task[Any], float] = WeakKeyDictionary()
        self.polls = Durations(POLL_BOUNDS_S, clock)

    def now_ns(self) -> int:
        """UTC nanoseconds since 1970."""
        return self._clock.now_ns()

    def monotonic_s(self) -> float:
        """Seconds that never step."""
        self._beat()
        return self._clock.monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        """Wait; what went before, since the wait before this one, was a poll."""
        task = asyncio.current_task()
        self._beat(duration_s)
        if task is None:
            await self._clock.sleep(duration_s)
            return
        if task in self._woken_s:
            self.polls.observe(self._clock.monotonic_s() - self._woken_s[task])
        await self._clock.sleep(duration_s)
        self._woken_s[task] = self._clock.monotonic_s()

    def listen(self, pulse: Pulse) -> None:
        """Let the task that calls this be heard of whenever it looks at the clock."""
        self._pulse, self._reader = pulse, asyncio.current_task()

    def _beat(self, after_s: float = 0.0) -> None:
        # what asks another device beside, or listens to a bus in a thread, is not the reader
        if self._reader is not None and _current_task() is self._reader:
            self._pulse.beat(after_s)

    def forget(self) -> None:
        """Begin anew: what lies between two connections is no poll."""
        task = asyncio.current_task()
        if task is not None:
            self._woken_s.pop(task, None)


def _current_task() -> asyncio.Task[Any] | None:
    """The task that runs; None in a thread without an event loop."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None


class TimedSource:
    """A source whose polls are timed.

    Parameters
    ----------
    make
        Makes the source, which is to wait by this clock.
    """

    def __init__(self, make: Callable[[Clock], SampleSource], clock: Clock) -> None:
        self._clock = PollClock(clock)
        self._source = make(self._clock)

    def listen(self, pulse: Pulse) -> None:
        """Let the task that calls this, and reads the source, be heard of while it does."""
        self._clock.listen(pulse)

    @property
    def polls(self) -> Durations:
        """What polls took so far."""
        return self._clock.polls

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Frames that the source has not used, by reason."""
        return refused_frames_of(self._source)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link, as the source does, and raises."""
        self._clock.forget()
        async with self._source.connect() as blocks:
            yield blocks
