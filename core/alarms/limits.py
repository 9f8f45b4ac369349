"""Alert and danger limits of a quantity, with a deadband."""

import math
from dataclasses import dataclass
from functools import cached_property

from core.alarms.alarm import AlarmLevel, Condition, unknown
from core.quality import Reading, Reason

MAYBE_TOO_LOW = (Reason.SPEED_IMPLAUSIBLE,)
"""Doubts about a reading that may have made it too low: it was read beside its line."""


@dataclass(frozen=True)
class Limits:
    """Above which values an alarm becomes active; in the unit of the quantity.

    Parameters
    ----------
    alert, danger
        None where there is no such level.
    deadband
        How far below a limit the value must fall for its level to be left.

    Raises
    ------
    ValueError
        If there is no limit at all, or one is not a number above zero, alert is not below danger,
        or the deadband is negative or not below the lower limit.
    """

    alert: float | None = None
    danger: float | None = None
    deadband: float = 0.0

    def __post_init__(self) -> None:
        given = [limit for limit in (self.alert, self.danger) if limit is not None]
        if not given:
            raise ValueError("limits without any limit: give alert, danger or both")
        for limit in given:
            if not (math.isfinite(limit) and limit > 0.0):
                raise ValueError(f"limit {limit:g} must be a number above 0")
        if len(given) == 2 and not given[0] < given[1]:
            raise ValueError(f"alert {given[0]:g} must be below danger {given[1]:g}")
        if not 0.0 <= self.deadband < given[0]:
            raise ValueError(
                f"deadband {self.deadband:g} must be 0 or more, and below {given[0]:g}"
            )

    @cached_property
    def lowest(self) -> float:
        """The limit that is passed first."""
        return min(limit for limit in (self.alert, self.danger) if limit is not None)

    def passed(self, value: float, held: AlarmLevel | None) -> AlarmLevel | None:
        """The worst level whose limit a value is above, or not yet clearly below again."""
        levels = [
            level
            for level, limit in zip(AlarmLevel, (self.alert, self.danger), strict=True)
            if limit is not None
            and value > (limit - self.deadband if (held or 0) >= level else limit)
        ]
        return max(levels, default=None)

    def of(self, level: AlarmLevel | None) -> float | None:
        """The limit of a level; of none, the one that is passed first."""
        if level is None:
            return self.danger if self.alert is None else self.alert
        return self.danger if level is AlarmLevel.DANGER else self.alert


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
    if reading.value is None:
        why = reading.quality.reason
        return unknown(why, why if why is Reason.STANDSTILL else None)
    level = limits.passed(reading.value, held)
    if reading.quality.reason in MAYBE_TOO_LOW and (level or 0) < (held or 0):
        return unknown(reading.quality.reason)
    reason = "ok" if level is None else "above_limit"
    return Condition(level, value=reading.value, limit=limits.of(level), reason=reason)
