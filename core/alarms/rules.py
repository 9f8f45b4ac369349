"""Rules of alarms: limits by operating condition, delays, and what is watched on a unit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from core.alarms.alarm import AlarmRule
from core.condition.cells import OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement, Limits, judge, unknown
from core.monitor.assessment import Assessment
from core.quality import NOT_MEASURED, Reading, Reason
from core.units import ns_from_s

EVERY_STATE = frozenset(OperatingState)

States = frozenset[OperatingState]

Range = tuple[float, float]
"""From the first, up to but not including the second."""


@dataclass(frozen=True)
class Region:
    """Operating states and ranges of the other conditions; None where any value will do.

    A condition cell is a region whose ranges are the cell's bounds. Attitudes are within 0 to 360.
    """

    states: States = EVERY_STATE
    eccentricity_ratio: Range | None = None
    oil_temperature_c: Range | None = None
    attitude_deg: Range | None = None

    def holds(self, point: OperatingPoint) -> bool | None:
        """Whether a point lies in it; None where that is not known."""
        is_inside = point.state in self.states
        is_known = is_inside or point.state is not OperatingState.UNKNOWN
        inside: list[bool | None] = [is_inside if is_known else None]
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


def rule_of(on_delay_s: float, off_delay_s: float, *, is_latching: bool = False) -> AlarmRule:
    """A rule with delays in seconds."""
    return AlarmRule(ns_from_s(on_delay_s), ns_from_s(off_delay_s), is_latching)


@dataclass(frozen=True)
class LimitRule:
    """Limits of a value by operating condition. Where none hold, the alarm is suppressed by design.

    Where the condition is not known nothing is suppressed, and all limits that may hold count.

    Parameters
    ----------
    limits
        Hold in the given states, outside of all tables; None if only tables hold, as for zones.
    states
        Operating states in which `limits` count.
    tables
        Regions of the condition in which other limits hold instead; no two overlap.
    """

    limits: Limits | None
    rule: AlarmRule
    states: States = EVERY_STATE
    tables: tuple[tuple[Region, Limits], ...] = ()

    def at(self, point: OperatingPoint) -> Sequence[Limits]:
        """The limits that hold at a point, or may hold; empty where none do."""
        possible = []
        for region, limits in self.tables:
            holds = region.holds(point)
            if holds:
                return (limits,)
            if holds is None:
                possible.append(limits)
        counts = point.state in self.states or point.state is OperatingState.UNKNOWN
        return (*possible, self.limits) if counts and self.limits is not None else possible

    def judge(self, reading: Reading, point: OperatingPoint, held: AlarmLevel | None) -> Judgement:
        """Worst judgement by all limits that may hold; of equal ones, by the strictest limit.

        Where none hold, the condition is unknown: an alarm does not return by being suppressed.
        """
        found = [judge(reading, limits, held) for limits in self.at(point)]
        if not found:
            word = point.state.name.lower()
            return unknown(word, word)
        found.sort(key=lambda judged: float("inf") if judged.limit is None else judged.limit)
        return max(found, key=lambda judged: judged.level or 0)


def point_of(assessment: Assessment) -> OperatingPoint:
    """Operating condition of a result, doubted or not; a standstill is known without a state."""
    condition, readings = assessment.condition, assessment.readings
    state = OperatingState.UNKNOWN if condition is None else condition.state
    speed = readings.get("speed_rpm", NOT_MEASURED)
    if state is OperatingState.UNKNOWN and speed.quality.reason is Reason.STANDSTILL:
        state = OperatingState.STANDSTILL
    names = ("eccentricity_ratio", "attitude_angle_deg", "oil_temperature_c")
    return OperatingPoint(state, *(readings.get(name, NOT_MEASURED).value for name in names))


BearingRules: TypeAlias = Mapping[str, LimitRule | None]
"""Limits of one bearing, by the `rule` of the kinds of alarms that they make; None makes none."""


@dataclass(frozen=True)
class UnitRules:
    """Rules of one unit; None where nothing is watched, such as clock and link of a replay.

    Parameters
    ----------
    slow_channel
        Of slow channels that a limit needs; another device may deliver them, and later.
    bearings
        By bearing.
    films
        Of changes of each film's stiffness, which `core.change` decides.
    clock_offset, clock_drift
        Of the device's stamps against the host, s; of its sampling, parts per million.
    time_stamps
        That the device's stamps fit the sample index.
    link
        That samples arrive.
    """

    channel: AlarmRule = field(default_factory=lambda: rule_of(0.5, 10.0))
    slow_channel: AlarmRule = field(default_factory=lambda: rule_of(5.0, 10.0))
    bearings: Mapping[str, BearingRules] = field(default_factory=dict)
    films: AlarmRule | None = None
    clock_offset: LimitRule | None = field(
        default_factory=lambda: LimitRule(Limits(2.0), rule_of(30.0, 30.0))
    )
    clock_drift: LimitRule | None = field(
        default_factory=lambda: LimitRule(Limits(200.0), rule_of(60.0, 60.0))
    )
    time_stamps: AlarmRule | None = field(default_factory=lambda: rule_of(0.0, 600.0))
    link: AlarmRule | None = field(default_factory=lambda: rule_of(10.0, 0.0))
