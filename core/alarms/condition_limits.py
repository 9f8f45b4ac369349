"""`ConditionLimits`: which limits hold in which operating state and condition cell, if any."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Self

from core.condition.cells import OperatingPoint
from core.condition.operating_state import STEADY, OperatingState
from core.limits import AlarmLevel, Condition, Limits, judge, unknown
from core.monitor.assessment import Assessment
from core.quality import Reading, Reason, missing

AT_SPEED = STEADY
"""Where limits of vibration count unless said otherwise."""

EVERY_STATE = frozenset(OperatingState)

States = frozenset[OperatingState]

Range = tuple[float, float]
"""From the first, up to but not including the second."""


@dataclass(frozen=True)
class Region:
    """Operating states and ranges of the other conditions; None where any value will do.

    A condition cell is a region whose ranges are the cell's bounds.

    Parameters
    ----------
    attitude_deg
        Within 0 to 360.

    Raises
    ------
    ValueError
        If there is no state, or a range ends where it begins or before.
    """

    states: States = EVERY_STATE
    eccentricity_ratio: Range | None = None
    oil_temperature_c: Range | None = None
    attitude_deg: Range | None = None

    def __post_init__(self) -> None:
        if not self.states:
            raise ValueError("limits that count in no operating state")
        for low, high in filter(None, self.ranges):
            if low >= high:
                raise ValueError(f"a range from {low:g} to {high:g} must rise")

    def holds(self, point: OperatingPoint) -> bool | None:
        """Whether a point lies in it; None where that is not known."""
        is_known_state = point.state is not OperatingState.UNKNOWN
        inside = [point.state in self.states if is_known_state or self._has_every_state else None]
        attitude = None if point.attitude_deg is None else point.attitude_deg % 360.0
        values = (point.eccentricity_ratio, point.oil_temperature_c, attitude)
        for bounds, value in zip(self.ranges, values, strict=True):
            if bounds is not None:
                inside.append(None if value is None else bounds[0] <= value < bounds[1])
        return None if None in inside and False not in inside else all(inside)

    def overlaps(self, other: "Region") -> bool:
        """Whether a point may lie in both."""
        both = zip(self.ranges, other.ranges, strict=True)
        return bool(self.states & other.states) and all(
            one is None or two is None or (one[0] < two[1] and two[0] < one[1]) for one, two in both
        )

    @property
    def ranges(self) -> tuple[Range | None, Range | None, Range | None]:
        """Of eccentricity ratio, oil temperature and attitude angle."""
        return self.eccentricity_ratio, self.oil_temperature_c, self.attitude_deg

    @property
    def _has_every_state(self) -> bool:
        return OperatingState.UNKNOWN in self.states


@dataclass(frozen=True)
class ConditionLimits:
    """Limits by condition. Where there are none, an alarm is suppressed by design.

    Where the condition is not known nothing is suppressed, and all limits that may hold count.

    Parameters
    ----------
    tables
        Regions with their limits.
    otherwise
        What holds in a region, outside of all tables.

    Raises
    ------
    ValueError
        If there are no limits at all, or two tables overlap.
    """

    tables: tuple[tuple[Region, Limits], ...] = ()
    otherwise: tuple[Region, Limits] | None = None

    def __post_init__(self) -> None:
        if not self.tables and self.otherwise is None:
            raise ValueError("no limits for any operating state")
        for (one, _), (other, _) in combinations(self.tables, 2):
            if one.overlaps(other):
                states = ", ".join(s.name.lower() for s in sorted(one.states & other.states))
                raise ValueError(f"two limits for the operating state {states}")

    @classmethod
    def single(cls, limits: Limits, states: Iterable[OperatingState] = EVERY_STATE) -> Self:
        """The same limits in some states."""
        return cls(otherwise=(Region(frozenset(states)), limits))

    def at(self, point: OperatingPoint) -> Sequence[Limits]:
        """The limits that hold at a point, or may hold; empty where nothing counts."""
        found = [(region.holds(point), limits) for region, limits in self.tables]
        sure = [limits for holds, limits in found if holds]
        if sure:
            return sure
        possible = [limits for holds, limits in found if holds is None]
        if self.otherwise is not None and self.otherwise[0].holds(point) is not False:
            possible.append(self.otherwise[1])
        return possible

    def judge(self, reading: Reading, point: OperatingPoint, held: AlarmLevel | None) -> Condition:
        """Compare a reading with what holds now."""
        return worst_of([judge(reading, limits, held) for limits in self.at(point)], point)


def worst_of(found: Iterable[Condition], point: OperatingPoint) -> Condition:
    """The worst of the conditions by all limits that may hold; of equal ones, the strictest.

    In a condition in which an alarm does not count nothing is known, and nothing told: nothing is
    judged meanwhile, so that nothing returns to normal by being suppressed.
    """
    by_limit = sorted(found, key=lambda c: float("inf") if c.limit is None else c.limit)
    word = point.state.name.lower()
    return max(by_limit, key=lambda c: c.level or 0, default=unknown(word, word))


def point_of(assessment: Assessment) -> OperatingPoint:
    """Under which condition a result was found, doubted or not.

    Where no operating state is known, a standstill at least is.
    """
    condition, readings = assessment.condition, assessment.readings
    state = OperatingState.UNKNOWN if condition is None else condition.state
    speed = readings.get("speed_rpm", NOT_MEASURED)
    if state is OperatingState.UNKNOWN and speed.quality.reason is Reason.STANDSTILL:
        state = OperatingState.STANDSTILL
    names = ("eccentricity_ratio", "attitude_angle_deg", "oil_temperature_c")
    return OperatingPoint(state, *(readings.get(name, NOT_MEASURED).value for name in names))


NOT_MEASURED = missing(Reason.NOT_MEASURED)
