"""Levels, limits, zones and delays: what alarms and changes of films are judged by."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Self

from core.condition.cells import OperatingPoint
from core.quality import Reading, Reason


class AlarmLevel(IntEnum):
    """How urgent an alarm is: its priority."""

    ALERT = 1
    DANGER = 2


@dataclass(frozen=True)
class Condition:
    """What is found at one moment of what an alarm watches.

    Parameters
    ----------
    level
        Which limit is passed; None if none is. While nothing is known, that which was known last.
    is_known
        Whether it could be judged at all; if not, it is neither active nor returned.
    value, limit
        What was compared with what, where there are numbers.
    reason
        Why it is so, in a word; "ok" if all is well.
    suppressed_by
        Why, by design, the alarm counts for nothing now; None if it counts.
    point
        Under which operating condition, where that is known of a level.
    """

    level: AlarmLevel | None = None
    is_known: bool = True
    value: float | None = None
    limit: float | None = None
    reason: str = "ok"
    suppressed_by: str | None = None
    point: OperatingPoint | None = None


WITHIN = Condition()
"""All is well, and there is no number to it."""


NEVER_JUDGED = Condition(is_known=False, reason="waiting_for_data")


def unknown(reason: str, suppressed_by: str | None = None) -> Condition:
    """Build the condition of which nothing is known now."""
    return Condition(is_known=False, reason=reason, suppressed_by=suppressed_by)


MAYBE_TOO_LOW = (Reason.SPEED_IMPLAUSIBLE,)
"""Doubts about a reading that may have made it too low: it was read beside its line."""


@dataclass(frozen=True)
class Limits:
    """Beyond which values an alarm becomes active; in the unit of the quantity.

    Parameters
    ----------
    alert, danger
        Above which values; None where there is no such level.
    deadband
        How far inside a limit the value must come back for its level to be left.
    alert_below, danger_below
        Below which values.

    Raises
    ------
    ValueError
        If there is no limit at all, or one is not a number above zero, danger does not lie outside
        alert, or the deadband is negative, or so wide that a value could be left by no level.
    """

    alert: float | None = None
    danger: float | None = None
    deadband: float = 0.0
    alert_below: float | None = None
    danger_below: float | None = None

    def __post_init__(self) -> None:
        rising = [self.danger_below, self.alert_below, self.alert, self.danger]
        given = [limit for limit in rising if limit is not None]
        if not given:
            raise ValueError("limits without any limit: give alert, danger or both")
        for limit in given:
            if not (math.isfinite(limit) and limit > 0.0):
                raise ValueError(f"limit {limit:g} must be a number above 0")
        self._check_order("alert", self.alert, "danger", self.danger)
        self._check_order("danger_below", self.danger_below, "alert_below", self.alert_below)
        self._check_order("lower limit", self._highest_low, "upper limit", self._lowest_high)
        if not 0.0 <= self.deadband < self._room:
            raise ValueError(
                f"deadband {self.deadband:g} must be 0 or more, and below {self._room:g}"
            )

    @staticmethod
    def _check_order(lower: str, low: float | None, upper: str, high: float | None) -> None:
        if low is not None and high is not None and not low < high:
            raise ValueError(f"{lower} {low:g} must be below {upper} {high:g}")

    @cached_property
    def _lowest_high(self) -> float | None:
        return min((x for x in (self.alert, self.danger) if x is not None), default=None)

    @cached_property
    def _highest_low(self) -> float | None:
        low = (x for x in (self.alert_below, self.danger_below) if x is not None)
        return max(low, default=None)

    @cached_property
    def _room(self) -> float:
        """What the deadband must be below: inside it there must be values that are within."""
        if self._lowest_high is None:
            return math.inf
        if self._highest_low is None:
            return self._lowest_high
        return (self._lowest_high - self._highest_low) / 2.0

    @cached_property
    def lowest(self) -> float:
        """The upper limit that is passed first; infinite if there is none."""
        return math.inf if self._lowest_high is None else self._lowest_high

    def is_within(self, value: float) -> bool:
        """Whether a value passes no limit."""
        return value <= self.lowest and (self._highest_low is None or value >= self._highest_low)

    def passed(self, value: float, held: AlarmLevel | None) -> AlarmLevel | None:
        """The worst level whose limit a value is beyond, or not yet clearly inside again."""
        levels = [
            level
            for level, high, low in zip(
                AlarmLevel,
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
        """Whether a value is nearer to its lower limits."""
        if self._highest_low is None or self._lowest_high is None:
            return self._highest_low is not None
        return value < (self._highest_low + self._lowest_high) / 2.0

    def of(self, level: AlarmLevel | None, value: float = math.inf) -> float | None:
        """The limit of a level on the side of a value; of none, the one that is passed first."""
        if self.is_low(value):
            alert, danger = self.alert_below, self.danger_below
        else:
            alert, danger = self.alert, self.danger
        if level is None:
            return danger if alert is None else alert
        return danger if level is AlarmLevel.DANGER else alert

    def reason(self, level: AlarmLevel | None, value: float) -> str:
        """What a level means, in a word."""
        if level is None:
            return "ok"
        return "below_limit" if self.is_low(value) else "above_limit"


def judge(reading: Reading, limits: Limits, held: AlarmLevel | None) -> Condition:
    """Compare a reading with limits.

    A reading at a speed that something contradicts may be too low: it can raise an alarm but not
    clear it. A shaft that does not turn has no
    vibration to be judged: its alarms are suppressed, not returned, for it may be the speed that
    is wrong.

    Parameters
    ----------
    held
        The level of the condition before.
    """
    value = reading.value
    if value is None:
        why = reading.quality.reason
        return unknown(why, why if why is Reason.STANDSTILL else None)
    level = limits.passed(value, held)
    if reading.quality.reason in MAYBE_TOO_LOW and (level or 0) < (held or 0):
        return unknown(reading.quality.reason)
    return Condition(
        level, value=value, limit=limits.of(level, value), reason=limits.reason(level, value)
    )


ZONES = {AlarmLevel.ALERT: "zone_c", AlarmLevel.DANGER: "zone_d"}


@dataclass(frozen=True)
class ZoneLimits(Limits):
    """Zones as limits: C is an alert, D a danger; what is within says whether it is A or B.

    Parameters
    ----------
    zone_b
        Where zone B begins.
    """

    zone_b: float = 0.0

    @classmethod
    def between(cls, a_b: float, b_c: float, c_d: float, deadband: float = 0.0) -> Self:
        """Zones by their boundaries.

        Raises
        ------
        ValueError
            If they do not rise from above zero, or the deadband is not below the boundary B/C.
        """
        if not 0.0 < a_b < b_c:
            raise ValueError(f"boundary A/B {a_b:g} must be above 0 and below B/C {b_c:g}")
        return cls(b_c, c_d, deadband, zone_b=a_b)

    def reason(self, level: AlarmLevel | None, value: float) -> str:
        """The zone."""
        if level is None:
            return "zone_a" if value <= self.zone_b else "zone_b"
        return ZONES[level]


@dataclass(frozen=True)
class DelayTimer:
    """On-delay and off-delay of a level.

    Parameters
    ----------
    is_on
        Whether the level counts.
    opposed_ns
        Known time for which the condition has contradicted `is_on` without interruption.
    last_ns
        Time of the newest contradiction; None if nothing was known since.
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
        """Update with the condition of now.

        Parameters
        ----------
        elapsed_ns
            Known time that a contradiction stands for. By default the time since the one before;
            a clock that was put back adds nothing.
        """
        if wanted == self.is_on:
            return ON if wanted else RESTED
        if elapsed_ns is None:
            elapsed_ns = 0 if self.last_ns is None else max(0, now_ns - self.last_ns)
        opposed_ns = self.opposed_ns + elapsed_ns
        if opposed_ns >= (on_delay_ns if wanted else off_delay_ns):
            return ON if wanted else RESTED
        return DelayTimer(self.is_on, opposed_ns, now_ns)

    def paused(self) -> "DelayTimer":
        """The timer when nothing is known: what is pending stays pending, and no time passes."""
        return self if self.last_ns is None else replace(self, last_ns=None)


RESTED = DelayTimer()


ON = DelayTimer(is_on=True)
