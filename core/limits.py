"""Levels, limits, zones and delays, by which alarms and changes of films are judged."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

from core.condition.cells import OperatingPoint
from core.quality import Reading, Reason


class AlarmLevel(IntEnum):
    """How urgent an alarm is: its priority."""

    ALERT = 1
    DANGER = 2


@dataclass(frozen=True)
class Judgement:
    """What an alarm watches, judged at one moment.

    Parameters
    ----------
    level
        Level whose limit is passed, if any. While the condition is unknown, the last known level.
    is_known
        Whether the condition could be judged; if not, it is neither active nor returned.
    value, limit
        Value and the limit that it was compared with, where there are numbers.
    reason
        Why, in a word; "ok" if no limit is passed.
    suppressed_by
        Why the alarm is suppressed by design; None if it is not.
    point
        Operating condition under which a limit was passed, if known.
    """

    level: AlarmLevel | None = None
    is_known: bool = True
    value: float | None = None
    limit: float | None = None
    reason: str = "ok"
    suppressed_by: str | None = None
    point: OperatingPoint | None = None


WITHIN = Judgement()
"""Within limits, without a value."""


NEVER_JUDGED = Judgement(is_known=False, reason="waiting_for_data")


def unknown(reason: str, suppressed_by: str | None = None) -> Judgement:
    """A judgement while the condition is unknown."""
    return Judgement(is_known=False, reason=reason, suppressed_by=suppressed_by)


MAYBE_TOO_LOW = (Reason.SPEED_IMPLAUSIBLE,)
"""Reasons of doubt with which a reading may be too low, as it was read beside its line."""


@dataclass(frozen=True)
class Limits:
    """Limits beyond which an alarm becomes active, in the unit of the quantity.

    Parameters
    ----------
    alert, danger
        Upper limits, above zero and rising; None if there is no such level. One limit is given.
    deadband
        How far inside a limit a value must be for its level to end.
    alert_below, danger_below
        Lower limits.
    """

    alert: float | None = None
    danger: float | None = None
    deadband: float = 0.0
    alert_below: float | None = None
    danger_below: float | None = None

    @cached_property
    def _lowest_high(self) -> float | None:
        return min((x for x in (self.alert, self.danger) if x is not None), default=None)

    @cached_property
    def _highest_low(self) -> float | None:
        low = (x for x in (self.alert_below, self.danger_below) if x is not None)
        return max(low, default=None)

    def is_within(self, value: float) -> bool:
        """Whether a value passes no limit."""
        high, low = self._lowest_high, self._highest_low
        return (high is None or value <= high) and (low is None or value >= low)

    def passed(self, value: float, held: AlarmLevel | None) -> AlarmLevel | None:
        """The worst level whose limit a value passes; a held level ends inside its deadband."""
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


def judge(reading: Reading, limits: Limits, held: AlarmLevel | None) -> Judgement:
    """Compare a reading with limits, after a judgement with the level `held`.

    A reading at an implausible speed may be too low: it can raise an alarm but not clear it. A
    shaft at standstill has no vibration: its alarms are suppressed and do not return, since the
    speed itself may be wrong.
    """
    value = reading.value
    if value is None:
        why = reading.quality.reason
        return unknown(why, why if why is Reason.STANDSTILL else None)
    level = limits.passed(value, held)
    if reading.quality.reason in MAYBE_TOO_LOW and (level or 0) < (held or 0):
        return unknown(reading.quality.reason)
    return Judgement(
        level, value=value, limit=limits.of(level, value), reason=limits.reason(level, value)
    )


ZONES = {AlarmLevel.ALERT: "zone_c", AlarmLevel.DANGER: "zone_d"}


@dataclass(frozen=True)
class ZoneLimits(Limits):
    """Zones as limits: C is an alert, D a danger; A and B, from `zone_b` on, are within limits."""

    zone_b: float = 0.0

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

        A contradiction stands for the known time since the one before, unless it is given; a clock
        that was put back adds nothing.
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
        """The timer while the condition is unknown: pending, with no time passing."""
        return self if self.last_ns is None else replace(self, last_ns=None)


INACTIVE = DelayTimer()


ON = DelayTimer(is_on=True)
