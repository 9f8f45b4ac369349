"""Changes of condition that are no damage: what must not raise an alarm."""

from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray, TimeArray
from core.units import NS_PER_S

DAY_NS = 86_400 * NS_PER_S


@dataclass(frozen=True)
class ConditionChange:
    """A change of condition that is no damage.

    Parameters
    ----------
    eccentricity_ratio
        Where the shaft runs meanwhile, in every bearing, with its usual wander; None as usual.
    oil_offset_c
        By how much the oil is warmer than usual while running: a failing cooler, or one valve more.
    """

    start_ns: int
    stop_ns: int
    eccentricity_ratio: float | None = None
    oil_offset_c: float = 0.0

    def holds(self, time_ns: TimeArray) -> FloatArray:
        """(n,) 1 while the change lasts, else 0."""
        return ((time_ns >= self.start_ns) & (time_ns < self.stop_ns)).astype(np.float64)


CENTRED, OUTWARD = 0.12, 0.60
WARM_C, COLD_C = 3.0, -3.0


def four_fold(
    start_ns: int, days: float = 30.0, *, stiffer: bool = True
) -> tuple[ConditionChange, ConditionChange]:
    """Let films become four times as stiff, or as soft, by condition alone.

    For `days` before `start_ns` the shaft runs near the centre in warm oil, then for as long far
    out in cold oil, or the other way round. It is 3.5 to 8 times in the direction that feels it
    most, as machines differ. Both are within what a healthy machine meets in spring and autumn; in
    midwinter the colder oil, in midsummer the warmer, may be beyond it.
    """
    first, second = (CENTRED, WARM_C), (OUTWARD, COLD_C)
    if not stiffer:
        first, second = second, first
    span_ns = round(days * DAY_NS)
    return (
        ConditionChange(start_ns - span_ns, start_ns, *first),
        ConditionChange(start_ns, start_ns + span_ns, *second),
    )


def cooling_failure(
    start_ns: int, days: float = 5.0, oil_offset_c: float = 12.0
) -> ConditionChange:
    """Oil far warmer than it ever was: a condition that no healthy history holds."""
    return ConditionChange(start_ns, start_ns + round(days * DAY_NS), oil_offset_c=oil_offset_c)
