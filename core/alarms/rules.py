"""What is watched on a unit, and by which rules."""

from dataclasses import dataclass, field

from core.alarms.alarm import AlarmRule
from core.alarms.condition_limits import EVERY_STATE, ConditionLimits, Region, States
from core.limits import Limits
from core.units import ns_from_s


def rule_of(on_delay_s: float, off_delay_s: float, *, is_latching: bool = False) -> AlarmRule:
    """A rule with delays in seconds."""
    return AlarmRule(ns_from_s(on_delay_s), ns_from_s(off_delay_s), is_latching)


@dataclass(frozen=True)
class LimitRule:
    """A value beyond a limit.

    Parameters
    ----------
    states
        Operating states in which it counts.
    tables
        Regions of the condition in which other limits hold instead.
    """

    limits: Limits
    rule: AlarmRule
    states: States = EVERY_STATE
    tables: tuple[tuple[Region, Limits], ...] = ()

    @property
    def by_condition(self) -> ConditionLimits:
        """The limits with the conditions under which they hold."""
        return ConditionLimits(self.tables, (Region(self.states), self.limits))


@dataclass(frozen=True)
class ZoneRule:
    """A value in a zone that is not for long operation; zones differ by condition."""

    by_condition: ConditionLimits
    rule: AlarmRule


@dataclass(frozen=True)
class BearingRules:
    """What is watched on one bearing; None if it is not.

    Parameters
    ----------
    shaft_order1
        Relative shaft vibration at 1× in each direction, µm zero-to-peak.
    oil_temperature
        °C.
    shaft_overall
        Relative shaft vibration in each direction, broad-band, µm peak-to-peak.
    bearing_overall
        Absolute bearing vibration in each direction, broad-band, mm/s rms.
    eccentricity
        Distance of the shaft's centre from that of the bearing, as a share of the clearance.
    gap
        Mean of each probe's gap, µm.
    shaft_change, bearing_change
        How far the 1× vector has moved from its reference, µm zero-to-peak.
    shaft_zones, orbit_zones, bearing_zones
        Zones of the broad-band peak-to-peak values, of the farthest excursion, and of the bearing
        velocity.
    """

    shaft_order1: LimitRule | None = None
    oil_temperature: LimitRule | None = None
    shaft_overall: LimitRule | None = None
    bearing_overall: LimitRule | None = None
    eccentricity: LimitRule | None = None
    gap: LimitRule | None = None
    shaft_change: LimitRule | None = None
    bearing_change: LimitRule | None = None
    shaft_zones: ZoneRule | None = None
    orbit_zones: ZoneRule | None = None
    bearing_zones: ZoneRule | None = None


@dataclass(frozen=True)
class ClockRules:
    """What is watched of a device's clock.

    Parameters
    ----------
    offset
        Of its stamps against the host, s.
    drift
        Of its sampling against the host, parts per million.
    stamps
        That its stamps fit the sample index.
    """

    offset: LimitRule = field(default_factory=lambda: LimitRule(Limits(2.0), rule_of(30.0, 30.0)))
    drift: LimitRule = field(default_factory=lambda: LimitRule(Limits(200.0), rule_of(60.0, 60.0)))
    stamps: AlarmRule = field(default_factory=lambda: rule_of(0.0, 600.0))


@dataclass(frozen=True)
class UnitRules:
    """What is watched on a unit.

    Parameters
    ----------
    slow_channel
        Of slow channels that a limit needs; another device may deliver them, and later.
    bearings
        By bearing; one that is not there has no limits.
    films
        Of changes of each film's stiffness, which are decided elsewhere; None if they are not.
    clock, link
        None if the device's clock or its link is not judged, as in a replay.
    """

    channel: AlarmRule = field(default_factory=lambda: rule_of(0.5, 10.0))
    slow_channel: AlarmRule = field(default_factory=lambda: rule_of(5.0, 10.0))
    bearings: dict[str, BearingRules] = field(default_factory=dict)
    films: AlarmRule | None = None
    clock: ClockRules | None = field(default_factory=ClockRules)
    link: AlarmRule | None = field(default_factory=lambda: rule_of(10.0, 0.0))
