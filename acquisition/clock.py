"""Time as an argument: the program gets the system's, tests get their own."""

import asyncio
import time
from typing import Protocol


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
