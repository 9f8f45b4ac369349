"""Clocks, passed as arguments: the system clock, or a simulated clock in tests."""

import asyncio
import time
from typing import Protocol

from core.units import ns_from_s


class Clock(Protocol):
    """Clock with wall clock time, monotonic time and sleep."""

    def now_ns(self) -> int:
        """Return the wall clock time in UTC nanoseconds since 1970; the clock may be set."""
        ...

    def monotonic_s(self) -> float:
        """Return monotonic time in seconds from an arbitrary start; for deadlines and durations."""
        ...

    async def sleep(self, duration_s: float) -> None:
        """Suspend the current task for a duration in seconds."""
        ...


class SystemClock:
    """System clock of the host."""

    def now_ns(self) -> int:
        """Return the wall clock time in UTC nanoseconds since 1970."""
        return time.time_ns()

    def monotonic_s(self) -> float:
        """Return monotonic time in seconds since an arbitrary start."""
        return time.monotonic()

    async def sleep(self, duration_s: float) -> None:
        """Suspend the current task for a duration in seconds of the host."""
        await asyncio.sleep(duration_s)


class FastClock:
    """Clock that runs faster or slower than a reference clock by a constant factor; for replays.

    Parameters
    ----------
    clock
        Reference clock.
    speed
        Seconds of this clock per second of the reference clock; above 0.

    Raises
    ------
    ValueError
        If the speed is not positive.
    """

    def __init__(self, clock: Clock, speed: float) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed must be above 0, got {speed}")
        self._clock, self._speed = clock, speed
        self._start_ns, self._start_s = clock.now_ns(), clock.monotonic_s()

    def now_ns(self) -> int:
        """Return the time at creation plus the scaled elapsed time, UTC nanoseconds since 1970."""
        return self._start_ns + ns_from_s(self.monotonic_s())

    def monotonic_s(self) -> float:
        """Return the time since creation, in seconds of this clock."""
        return (self._clock.monotonic_s() - self._start_s) * self._speed

    async def sleep(self, duration_s: float) -> None:
        """Suspend the current task for a duration in seconds of this clock."""
        await self._clock.sleep(duration_s / self._speed)
