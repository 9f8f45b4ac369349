"""Time as an argument: the program gets the system's, tests get their own."""

import asyncio
import time
from typing import Protocol

from core.units import ns_from_s


class Clock(Protocol):
    """Wall time, steady time and waiting."""

    def now_ns(self) -> int:
        """UTC nanoseconds since 1970; may step."""
        ...

    def monotonic_s(self) -> float:
        """Seconds that never step; for deadlines and durations."""
        ...

    async def sleep(self, duration_s: float) -> None:
        """Wait."""
        ...


class SystemClock:
    """The clock of the machine padwatch runs on."""

    def now_ns(self) -> int:
        """UTC nanoseconds since 1970."""
        return time.time_ns()

    def monotonic_s(self) -> float:
        """Seconds since an arbitrary start."""
        return time.monotonic()

    async def sleep(self, duration_s: float) -> None:
        """Give the event loop to others for this long."""
        await asyncio.sleep(duration_s)


class FastClock:
    """A clock that runs at a multiple of another one's pace; for replays.

    Parameters
    ----------
    speed
        Seconds of this clock in a second of the other, above 0.

    Raises
    ------
    ValueError
        If the speed is not positive.
    """

    def __init__(self, clock: Clock, speed: float) -> None:
        if not speed > 0.0:
            raise ValueError(f"a clock runs at a positive speed, not {speed}")
        self._clock, self._speed = clock, speed
        self._start_ns, self._start_s = clock.now_ns(), clock.monotonic_s()

    def now_ns(self) -> int:
        """UTC nanoseconds since 1970, had it always run at this pace since it was made."""
        return self._start_ns + ns_from_s(self.monotonic_s())

    def monotonic_s(self) -> float:
        """Its own seconds since it was made."""
        return (self._clock.monotonic_s() - self._start_s) * self._speed

    async def sleep(self, duration_s: float) -> None:
        """Wait for this many of its own seconds."""
        await self._clock.sleep(duration_s / self._speed)
