"""Alarm rules of a unit: limits by operating condition, delays, monitored quantities."""

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
"""Half-open interval: the lower bound is included, the upper bound is excluded."""


@dataclass(frozen=True)
class Region:
    """Set of operating points: operating states, and half-open ranges; None for no restriction.

    A condition cell is a region with the bounds of the cell. Attitude angles are within 0° to 360°.
    """

    states: States = EVERY_STATE
    eccentricity_ratio: Range | None = None
    oil_temperature_c: Range | None = None
    attitude_deg: Range | None = None

    def holds(self, point: OperatingPoint) -> bool | None:
        """Whether the region contains an operating point; None if a value needed is unknown."""
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
        """Whether this region and the other region have operating points in common."""
        both = zip(self.ranges, other.ranges, strict=True)
        return bool(self.states & other.states) and all(
            one is None or two is None or (one[0] < two[1] and two[0] < one[1]) for one, two in both
        )

    @property
    def ranges(self) -> tuple[Range | None, Range | None, Range | None]:
        """Ranges of eccentricity ratio, oil temperature and attitude; None if unrestricted."""
        return self.eccentricity_ratio, self.oil_temperature_c, self.attitude_deg


def rule_of(on_delay_s: float, off_delay_s: float, *, is_latching: bool = False) -> AlarmRule:
    """Return an alarm rule with delays given in seconds."""
    return AlarmRule(ns_from_s(on_delay_s), ns_from_s(off_delay_s), is_latching)


@dataclass(frozen=True)
class LimitRule:
    """Limits of a value by operating condition; without valid limits the alarm is suppressed.

    An unknown operating condition suppresses no alarm: all limits that may be valid are applied.

    Parameters
    ----------
    limits
        Limits in the operating states `states`, outside the regions of `tables`; None if only
        `tables` apply, as for zones.
    rule
        Delays and latching of the alarm.
    states
        Operating states in which `limits` are valid.
    tables
        Disjoint regions of the operating condition with the limits that are valid there.
    """

    limits: Limits | None
    rule: AlarmRule
    states: States = EVERY_STATE
    tables: tuple[tuple[Region, Limits], ...] = ()

    def at(self, point: OperatingPoint) -> Sequence[Limits]:
        """Return the limits that are or may be valid at an operating point; empty if none are."""
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
        """Return the worst judgement of a reading by the limits that may be valid at a point.

        At equal levels, the judgement by the lowest limit is returned. `held` is the level of the
        previous judgement, for the deadband. Without valid limits the condition is unknown.
        """
        found = [judge(reading, limits, held) for limits in self.at(point)]
        if not found:
            word = point.state.name.lower()
            return unknown(word, word)
        found.sort(key=lambda judged: float("inf") if judged.limit is None else judged.limit)
        return max(found, key=lambda judged: judged.level or 0)


def point_of(assessment: Assessment) -> OperatingPoint:
    """Return the operating point of an assessment; None for each unknown quantity.

    Standstill is also derived from the speed reading if the operating state is unknown.
    """
    condition, readings = assessment.condition, assessment.readings
    state = OperatingState.UNKNOWN if condition is None else condition.state
    speed = readings.get("speed_rpm", NOT_MEASURED)
    if state is OperatingState.UNKNOWN and speed.quality.reason is Reason.STANDSTILL:
        state = OperatingState.STANDSTILL
    names = ("eccentricity_ratio", "attitude_angle_deg", "oil_temperature_c")
    return OperatingPoint(state, *(readings.get(name, NOT_MEASURED).value for name in names))


BearingRules: TypeAlias = Mapping[str, LimitRule | None]
"""Limit rules of one bearing, by `AlarmKind.rule`; None disables the alarms of the kind."""


@dataclass(frozen=True)
class UnitRules:
    """Alarm rules of one unit; None disables an alarm, such as clock and link in a replay.

    Parameters
    ----------
    channel
        Rule for faults of waveform channels.
    slow_channel
        Rule for faults of slow channels with limits. Its delays allow for late slow values.
    bearings
        Limit rules by bearing id.
    slow_limits
        Limit rules of recorded slow channels, by channel id.
    films
        Rule for changes of film stiffness, which `core.change` detects.
    clock_offset
        Limits, in seconds, of the offset of the device time stamps from host time.
    clock_drift
        Limits, in ppm, of the sampling-rate drift.
    time_stamps
        Rule for time stamps of the device that do not match the sample index.
    link
        Rule for a lost link to the device.
    """

    channel: AlarmRule = field(default_factory=lambda: rule_of(0.5, 10.0))
    slow_channel: AlarmRule = field(default_factory=lambda: rule_of(5.0, 10.0))
    bearings: Mapping[str, BearingRules] = field(default_factory=dict)
    slow_limits: Mapping[str, LimitRule] = field(default_factory=dict)
    films: AlarmRule | None = None
    clock_offset: LimitRule | None = field(
        default_factory=lambda: LimitRule(Limits(2.0), rule_of(30.0, 30.0))
    )
    clock_drift: LimitRule | None = field(
        default_factory=lambda: LimitRule(Limits(200.0), rule_of(60.0, 60.0))
    )
    time_stamps: AlarmRule | None = field(default_factory=lambda: rule_of(0.0, 600.0))
    link: AlarmRule | None = field(default_factory=lambda: rule_of(10.0, 0.0))
