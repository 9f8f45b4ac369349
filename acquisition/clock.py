"""Clocks, passed as arguments: the system clock, or a simulated clock in tests."""

import asyncio
import time
from typing import Protocol


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
