"""`Ticks`: when the next poll is due, and its number; overdue polls are left out."""

import math

from acquisition.clock import Clock

_EARLY = 1e-6
"""Share of a period by which rounding may put a tick before its time."""


class Ticks:
    """Polls at multiples of a period since the first one, counted across connections.

    Parameters
    ----------
    period_s
        Above 0.

    Attributes
    ----------
    epoch
        Second of the first tick, UTC: another one in each run of the program.
    """

    def __init__(self, clock: Clock, period_s: float) -> None:
        self._clock, self._period_s = clock, period_s
        self._origin_s: float | None = None
        self._last = -1
        self.epoch = 0

    async def next(self) -> int:
        """Wait for the next tick, the first of all excepted, and return its number.

        A tick whose time has passed is never returned, so that polls do not pile up; the jump in
        the number is what was missed.
        """
        if self._origin_s is None:
            self._origin_s = self._clock.monotonic_s()
            self.epoch = self._clock.now_ns() // 1_000_000_000
            self._last = 0
            return 0
        tick = max(self._last + 1, math.ceil(self._now() - _EARLY))
        wait_s = self._origin_s + tick * self._period_s - self._clock.monotonic_s()
        await self._clock.sleep(max(wait_s, 0.0))
        self._last = max(tick, math.floor(self._now() + _EARLY))
        return self._last

    def _now(self) -> float:
        """In ticks."""
        return (self._clock.monotonic_s() - (self._origin_s or 0.0)) / self._period_s
