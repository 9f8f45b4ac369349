"""Evaluation zones after ISO 20816-1: A and B for long operation, C for a while, D for none.

padwatch carries no numbers of any part of the standard; whoever owns it fills the table in.
"""

from dataclasses import dataclass
from typing import Self

from core.alarms.alarm import AlarmLevel
from core.alarms.limits import Limits

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
