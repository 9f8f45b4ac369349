"""Alert and danger limits of a quantity, above and below, with a deadband."""

import math
from dataclasses import dataclass
from functools import cached_property

from core.alarms.alarm import AlarmLevel, Condition, unknown
from core.quality import Reading, Reason

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
