"""Alarm levels, limits, vibration zones, judgements and delay timers."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum

from core.condition.cells import OperatingPoint
from core.quality import Reading, Reason


class AlarmLevel(IntEnum):
    """Severity of an active alarm, in rising order."""

    ALERT = 1
    DANGER = 2


LEVELS = tuple(AlarmLevel)
"""Both levels; iteration over the enumeration itself is slow."""


@dataclass(frozen=True)
class Judgement:
    """Result of checking the condition that an alarm monitors, at one time.

    Parameters
    ----------
    level
        Level whose limit is exceeded, or None. For an unknown condition, the last known level.
    is_known
        Whether the condition could be judged. An unknown condition neither raises nor clears an
        alarm.
    value, limit
        Value, and the limit with which it was compared; both None for a judgement without numbers.
    reason
        Reason as a code word; "ok" if no limit is exceeded.
    suppressed_by
        Reason why the alarm is suppressed by design; None if it is not suppressed.
    point
        Operating point at which a limit was exceeded; None if unknown or not exceeded.
    directions
        Directions in which the limit is exceeded, "x", "y" or "xy"; empty if the alarm has none.
    """

    level: AlarmLevel | None = None
    is_known: bool = True
    value: float | None = None
    limit: float | None = None
    reason: str = "ok"
    suppressed_by: str | None = None
    point: OperatingPoint | None = None
    directions: str = ""


WITHIN = Judgement()
"""Judgement that no limit is exceeded, without a value."""


NEVER_JUDGED = Judgement(is_known=False, reason="waiting_for_data")


def unknown(reason: str, suppressed_by: str | None = None) -> Judgement:
    """Return the judgement of an unknown condition, suppressed if `suppressed_by` is not None."""
    return Judgement(is_known=False, reason=reason, suppressed_by=suppressed_by)


@dataclass(frozen=True)
class Limits:
    """Limits beyond which an alarm becomes active, in the unit of the quantity.

    Parameters
    ----------
    alert, danger
        Upper limits of the two levels, rising; None if unused. At least one limit,
        upper or lower, is given.
    deadband
        Distance inside the limit that a value must reach for an active level to end.
    alert_below, danger_below
        Lower limits of the two levels; None if unused.
    """

    alert: float | None = None
    danger: float | None = None
    deadband: float = 0.0
    alert_below: float | None = None
    danger_below: float | None = None

    def passed(self, value: float, held: AlarmLevel | None) -> AlarmLevel | None:
        """Return the highest level whose limit a value exceeds, or None if it exceeds none.

        `held` is the level of the previous judgement, or None. This level and those below it end
        only if the value is inside the limit by at least the deadband.
        """
        levels = [
            level
            for level, high, low in zip(
                LEVELS,
                (self.alert, self.danger),
                (self.alert_below, self.danger_below),
                strict=True,
            )
            if self._is_beyond(value, high, low, self.deadband if (held or 0) >= level else 0.0)
        ]
        return max(levels, default=None)

    @staticmethod
    def _is_beyond(value: float, high: float | None, low: float | None, deadband: float) -> bool:
        too_high = high is not None and value > high - deadband
        return too_high or (low is not None and value < low + deadband)

    def is_low(self, value: float) -> bool:
        """Whether a value is nearer to the lower than to the upper limits.

        Without upper limits it is always true, without lower limits always false.
        """
        upper = [x for x in (self.alert, self.danger) if x is not None]
        lower = [x for x in (self.alert_below, self.danger_below) if x is not None]
        if not (upper and lower):
            return bool(lower)
        return value < (max(lower) + min(upper)) / 2.0

    def of(self, level: AlarmLevel | None, value: float = math.inf) -> float | None:
        """Return the limit of a level, the lower one if `is_low(value)`; None if it is unused.

        For the level None, return the alert limit or, if that is unused, the danger limit.
        """
        if self.is_low(value):
            alert, danger = self.alert_below, self.danger_below
        else:
            alert, danger = self.alert, self.danger
        if level is None:
            return danger if alert is None else alert
        return danger if level is AlarmLevel.DANGER else alert

    def reason(self, level: AlarmLevel | None, value: float) -> str:
        """Return "below_limit" or "above_limit" by the value, or "ok" if the level is None."""
        if level is None:
            return "ok"
        return "below_limit" if self.is_low(value) else "above_limit"


def judge(reading: Reading, limits: Limits, held: AlarmLevel | None) -> Judgement:
    """Return the judgement of a reading; `held` is the level of the previous judgement, or None.

    A reading at an implausible speed may be too low, as its 1× bin misses the spectral line: it can
    raise an alarm but not clear it. At standstill the alarms are suppressed but not cleared,
    because the speed reading may be wrong.
    """
    value = reading.value
    if value is None:
        why = reading.quality.reason
        return unknown(why, why if why is Reason.STANDSTILL else None)
    level = limits.passed(value, held)
    reason = reading.quality.reason
    if reason is Reason.SPEED_IMPLAUSIBLE and (level or 0) < (held or 0):
        return unknown(reason)
    return Judgement(
        level, value=value, limit=limits.of(level, value), reason=limits.reason(level, value)
    )


ZONES = {AlarmLevel.ALERT: "zone_c", AlarmLevel.DANGER: "zone_d"}


@dataclass(frozen=True)
class ZoneLimits(Limits):
    """Limits of vibration zones: alert in zone C, danger in zone D; zone B is above `zone_b`."""

    zone_b: float = 0.0

    def reason(self, level: AlarmLevel | None, value: float) -> str:
        """Return the name of the zone of a value, "zone_a" to "zone_d"."""
        if level is None:
            return "zone_a" if value <= self.zone_b else "zone_b"
        return ZONES[level]


@dataclass(frozen=True)
class DelayTimer:
    """Timer for the on-delay and off-delay of an alarm level.

    Parameters
    ----------
    is_on
        Whether the level is active.
    opposed_ns
        Accumulated known time for which the condition has differed from `is_on`.
    last_ns
        Newest time at which the condition differed; None after a pause, or if it has not differed.
    """

    is_on: bool = False
    opposed_ns: int = 0
    last_ns: int | None = None

    def step(
        self,
        wanted: bool,
        now_ns: int,
        on_delay_ns: int,
        off_delay_ns: int,
        elapsed_ns: int | None = None,
    ) -> "DelayTimer":
        """Return the timer updated at a time; `wanted` is whether the condition is present.

        Each call with `wanted` different from `is_on` adds `elapsed_ns`, by default the time since
        the previous such call, or 0 if the clock was set back. When the sum reaches `on_delay_ns`
        or `off_delay_ns`, `is_on` changes.
        """
        if wanted == self.is_on:
            return ON if wanted else INACTIVE
        if elapsed_ns is None:
            elapsed_ns = 0 if self.last_ns is None else max(0, now_ns - self.last_ns)
        opposed_ns = self.opposed_ns + elapsed_ns
        if opposed_ns >= (on_delay_ns if wanted else off_delay_ns):
            return ON if wanted else INACTIVE
        return DelayTimer(self.is_on, opposed_ns, now_ns)

    def paused(self) -> "DelayTimer":
        """Return the timer paused while the condition is unknown; the accumulated time is kept."""
        return self if self.last_ns is None else replace(self, last_ns=None)


INACTIVE = DelayTimer()


ON = DelayTimer(is_on=True)
