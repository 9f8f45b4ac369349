"""Measurement of poll durations, the time between two sleeps of a source that reads a device."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, Any
from weakref import WeakKeyDictionary

from prometheus_client import Histogram
from pydantic import Field

from acquisition.clock import Clock
from acquisition.source import SampleSource, refused_frames_of
from core.samples.blocks import SampleBlock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.models import SERVED

POLL_BOUNDS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0)
"""Upper bounds of the histogram of poll durations, from milliseconds on the plant network up to a
time-out."""


@dataclass(frozen=True)
class PollStatistics:
    """Statistics of the duration of polls of a device, including decoding of the answers."""

    __pydantic_config__ = SERVED

    n: int
    """Number of answered polls since the service started."""

    newest_s: Annotated[float, Field(examples=[0.012])]
    """Duration of the newest poll, s."""

    mean_s: Annotated[float, Field(examples=[0.011])]
    """Mean duration of polls, s."""


class PollClock:
    """Clock that measures the poll durations of a source, separately for each task of the source.

    The task that reads the source calls the clock repeatedly; each call is also a heartbeat.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pulse: Pulse = UNHEARD
        self._reader: asyncio.Task[Any] | None = None
        self._woken_s: WeakKeyDictionary[asyncio.Task[Any], float] = WeakKeyDictionary()
        self.statistics: PollStatistics | None = None
        self.polls = Histogram(
            "padwatch_poll_duration_seconds",
            "This is the duration of a poll, with decoding and delivery of its samples.",
            buckets=POLL_BOUNDS_S,
            registry=None,
        )

    def now_ns(self) -> int:
        """Return the time in ns since 1970 UTC."""
        return self._clock.now_ns()

    def monotonic_s(self) -> float:
        """Return the monotonic time in seconds, from an arbitrary start; send a heartbeat."""
        self._beat()
        return self._clock.monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        """Sleep, after recording the time since the task's previous sleep as a poll duration."""
        task = asyncio.current_task()
        self._beat(duration_s)
        if task is None:
            await self._clock.sleep(duration_s)
            return
        if task in self._woken_s:
            self._add(self._clock.monotonic_s() - self._woken_s[task])
        await self._clock.sleep(duration_s)
        self._woken_s[task] = self._clock.monotonic_s()

    def _add(self, duration_s: float) -> None:
        self.polls.observe(duration_s)
        before = self.statistics or PollStatistics(0, 0.0, 0.0)
        n = before.n + 1
        mean_s = before.mean_s + (duration_s - before.mean_s) / n
        self.statistics = PollStatistics(n, duration_s, mean_s)

    def set_pulse(self, pulse: Pulse) -> None:
        """Send a heartbeat to ``pulse`` at each clock call of the calling task."""
        self._pulse, self._reader = pulse, asyncio.current_task()

    def _beat(self, after_s: float = 0.0) -> None:
        # a task that polls another device or a thread that reads a bus sends no heartbeats
        if self._reader is not None and _current_task() is self._reader:
            self._pulse.beat(after_s)

    def forget(self) -> None:
        """Discard the calling task's last sleep, so that no poll duration is measured from it.

        To be called when a link is closed, since the time between two connections is no poll.
        """
        task = asyncio.current_task()
        if task is not None:
            self._woken_s.pop(task, None)


def _current_task() -> asyncio.Task[Any] | None:
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None


class TimedSource:
    """Wrapper of a sample source, made by `make` with a clock that measures poll durations."""

    def __init__(self, make: Callable[[Clock], SampleSource], clock: Clock) -> None:
        self._clock = PollClock(clock)
        self._source = make(self._clock)

    def set_pulse(self, pulse: Pulse) -> None:
        """Send a heartbeat to ``pulse`` at each clock call of the calling task, the reader."""
        self._clock.set_pulse(pulse)

    @property
    def polls(self) -> Histogram:
        """Prometheus histogram of the poll durations, s."""
        return self._clock.polls

    @property
    def statistics(self) -> PollStatistics | None:
        """Statistics of the poll durations; None before the first poll."""
        return self._clock.statistics

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Number of frames that the source dropped, by reason."""
        return refused_frames_of(self._source)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link of the source and yield its blocks; errors of the source are raised."""
        self._clock.forget()
        async with self._source.connect() as blocks:
            yield blocks
