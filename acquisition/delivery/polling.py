"""When devices are polled, and when a device that answers counts as lost all the same."""

import math

from acquisition.clock import Clock
from acquisition.errors import LinkError

_EARLY = 1e-6
"""Share of a period by which rounding may put a tick before its time."""

_SHARES: tuple[float, float] = ((3.0 - 5.0**0.5) / 2.0, (5.0**0.5 - 1.0) / 2.0)
"""Of a turn: multiples of the golden section fill an interval most evenly (Weyl 1916)."""


class PollClock:
    """Ticks at multiples of a period since the first one, counted across connections.

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
        """Wait for the next tick and return its number; the first one is due at once.

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
        """Time since the first tick, in ticks."""
        return (self._clock.monotonic_s() - (self._origin_s or 0.0)) / self._period_s


def incommensurate_period_s(longest_s: float, slot_s: float) -> float:
    """Longest period up to a limit in which polls of a ring meet a slot at all of its ages.

    A slot shows when its last sample was taken only to a poll that comes as it is finished. Where
    period and slot have a small ratio, as 0.25 s and 50 samples at 600 Hz have, polls meet all
    slots at the same age; while a device drifts through a whole slot it then seems not to drift at
    all, and after that to jump.
    """
    if slot_s <= longest_s:
        return slot_s * _golden_up_to(longest_s / slot_s)
    return slot_s / _golden_from(slot_s / longest_s)


def _golden_up_to(ratio: float) -> float:
    whole = math.floor(ratio)
    return max(n + share for n in (whole - 1, whole) for share in _SHARES if n + share <= ratio)


def _golden_from(ratio: float) -> float:
    whole = math.floor(ratio)
    return min(n + share for n in (whole, whole + 1) for share in _SHARES if n + share >= ratio)


class Freshness:
    """Watches something of a device that must change from time to time.

    Parameters
    ----------
    what
        In words; example: "the heartbeat".
    stale_after_s
        Longest time without a change.
    """

    def __init__(self, what: str, stale_after_s: float) -> None:
        self._what, self._stale_after_s = what, stale_after_s
        self._seen: bytes | None = None
        self._since_s = 0.0
        self._stood_still = False

    def opened(self, now_s: float) -> None:
        """Note a new connection: the time restarts unless the last one was lost to stale data."""
        if not self._stood_still:
            self._since_s = now_s

    def note(self, alive: bytes, now_s: float) -> None:
        """Note what was found.

        Raises
        ------
        LinkError
            If it has not changed for too long.
        """
        if alive != self._seen:
            self._seen, self._since_s, self._stood_still = alive, now_s, False
            return
        standing_s = now_s - self._since_s
        if standing_s > self._stale_after_s:
            self._stood_still = True
            raise LinkError(
                f"the device answers but its data stand still: {self._what} has not changed for"
                f" {standing_s:.1f} s"
            )
