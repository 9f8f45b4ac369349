"""Poll timing, and detection of devices that respond with stale data."""

import math

from acquisition.clock import Clock
from acquisition.errors import LinkError

_EARLY = 1e-6
"""Fraction of a period by which rounding may make a tick early."""

_SHARES: tuple[float, float] = ((3.0 - 5.0**0.5) / 2.0, (5.0**0.5 - 1.0) / 2.0)
"""Golden section fractions: their multiples modulo 1 are most evenly distributed (Weyl 1916)."""


class PollClock:
    """Timer for polls at multiples of a period since the first poll, also across reconnections.

    Parameters
    ----------
    period_s
        Period of the ticks; above 0.

    Attributes
    ----------
    epoch
        Time of the first tick, UTC seconds since 1970; identifies a run of the program. 0 before
        the first tick.
    """

    def __init__(self, clock: Clock, period_s: float) -> None:
        self._clock, self._period_s = clock, period_s
        self._origin_s: float | None = None
        self._last = -1
        self.epoch = 0

    async def next(self) -> int:
        """Wait for the next tick and return its number, from 0; the first tick is immediate.

        Ticks whose time has passed are skipped, so that polls do not accumulate. The gap in the
        numbers is the number of missed ticks.
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
        """Return the time since the first tick, in ticks."""
        return (self._clock.monotonic_s() - (self._origin_s or 0.0)) / self._period_s


def incommensurate_period_s(longest_s: float, slot_s: float) -> float:
    """Return the longest poll period up to `longest_s` with no simple ratio to the slot duration.

    A poll of a ring buffer measures the time of a slot's last sample only if it coincides with the
    end of the slot. If period and slot have a simple ratio, as 0.25 s and 50 samples at 600 Hz,
    all polls see slots of the same age: a drifting device then appears not to drift until it has
    drifted by a whole slot, and then to jump.
    """
    ratio = max(longest_s / slot_s, slot_s / longest_s)
    whole = math.floor(ratio)
    golden = [n + share for n in (whole - 1, whole, whole + 1) for share in _SHARES]
    if slot_s <= longest_s:
        return slot_s * max(each for each in golden if each <= ratio)
    return slot_s / min(each for each in golden if each >= ratio)


class Freshness:
    """Watchdog for a device value that must keep changing, such as a heartbeat.

    Parameters
    ----------
    what
        Name of the value for messages; example: "the heartbeat".
    stale_after_s
        Longest accepted time without a change of the value; the attribute of this name may be set.
    """

    def __init__(self, what: str, stale_after_s: float) -> None:
        self._what, self.stale_after_s = what, stale_after_s
        self._seen: bytes | None = None
        self._since_s = 0.0
        self._stood_still = False

    def opened(self, now_s: float) -> None:
        """Restart the timeout for a new connection, unless stale data ended the last connection."""
        if not self._stood_still:
            self._since_s = now_s

    def note(self, alive: bytes, now_s: float) -> None:
        """Update the watchdog with the present value `alive` at a monotonic time.

        Raises LinkError if the value has not changed for longer than `stale_after_s`.
        """
        if alive != self._seen:
            self._seen, self._since_s, self._stood_still = alive, now_s, False
            return
        standing_s = now_s - self._since_s
        if standing_s > self.stale_after_s:
            self._stood_still = True
            raise LinkError(
                f"the device replies, but {self._what} has not changed for {standing_s:.1f} s;"
                f" at most {self.stale_after_s:g} s are accepted"
            )
