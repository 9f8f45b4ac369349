"""From the plant file's settings to the rules of a unit."""

from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.rules import BearingRules, LimitRule, UnitRules, rule_of
from core.alarms.statistics import ChatterRule
from core.limits import Limits, ZoneLimits
from core.units import ns_from_s
from service.settings.alarms import AlarmSettings
from service.settings.bearings import BearingSettings
from service.settings.limits import GapLimitSettings, LimitSettings, states_of
from service.settings.origin import Origin
from service.settings.units import UnitSettings
from service.settings.zones import VectorReferenceSettings, ZoneSettings, ZoneTableSettings

ZONE_DEADBAND = 0.05
"""Of the boundary between A and B, where no deadband is given."""


def rules_of(unit: UnitSettings, alarms: AlarmSettings, origin: Origin) -> UnitRules:
    """What is watched on a unit; of a replay neither the link nor the clock."""
    is_live = origin is Origin.LIVE
    is_judged = is_live and alarms.clock == "judged"
    return UnitRules(
        channel=rule_of(alarms.channel_on_delay_s, alarms.channel_off_delay_s),
        slow_channel=rule_of(alarms.slow_channel_on_delay_s, alarms.channel_off_delay_s),
        bearings={bearing.id: _bearing(bearing) for bearing in unit.bearing},
        clock_offset=_clock_limit(alarms.max_clock_offset_s, 30.0) if is_judged else None,
        clock_drift=_clock_limit(alarms.max_clock_drift_ppm, 60.0) if is_judged else None,
        time_stamps=rule_of(0.0, 600.0) if is_judged else None,
        link=rule_of(alarms.link_lost_after_s, 0.0) if is_live else None,
    )


def chatter_rule_of(alarms: AlarmSettings) -> ChatterRule:
    """What counts as chattering."""
    return ChatterRule(alarms.chattering_activations, ns_from_s(alarms.chattering_window_s))


def references_of(unit: UnitSettings) -> list[VectorReference]:
    """Vectors of the plant file that 1× is compared with."""
    return [
        VectorReference(unit.id, bearing.id, state, _vectors(reference))
        for bearing in unit.bearing
        for reference in bearing.alarms.order1_reference
        for state in states_of(reference.states)
    ]


def _vectors(reference: VectorReferenceSettings) -> dict[str, OrderVector]:
    return {place: OrderVector(*vector) for place, vector in reference.vectors().items()}


def _bearing(bearing: BearingSettings) -> BearingRules:
    alarms, zones = bearing.alarms, bearing.alarms.zones
    return BearingRules(
        shaft_order1=_limits(alarms.shaft_order1_um_pk),
        oil_temperature=_limits(alarms.oil_temperature_c),
        shaft_overall=_limits(alarms.shaft_overall_um_pp),
        bearing_overall=_limits(alarms.bearing_overall_mm_s_rms),
        eccentricity=_limits(alarms.eccentricity_ratio),
        gap=_limits(alarms.gap_um),
        shaft_change=_limits(alarms.shaft_order1_change_um_pk),
        bearing_change=_limits(alarms.bearing_order1_change_um_pk),
        shaft_zones=_zones(zones.shaft_um_pp),
        orbit_zones=_zones(zones.shaft_max_um_pk),
        bearing_zones=_zones(zones.bearing_mm_s_rms),
    )


def _limits(found: LimitSettings | None) -> LimitRule | None:
    if found is None:
        return None
    rule = rule_of(found.on_delay_s, found.off_delay_s, is_latching=found.latching)
    tables = tuple(
        (table.region(found.states), _values(found.within(table))) for table in found.table
    )
    return LimitRule(_values(found), rule, states_of(found.states), tables)


def _values(found: LimitSettings) -> Limits:
    below = (
        (found.alert_below, found.danger_below)
        if isinstance(found, GapLimitSettings)
        else (None, None)
    )
    return Limits(found.alert, found.danger, found.deadband, *below)


def _zones(found: ZoneSettings | None) -> LimitRule | None:
    if found is None:
        return None
    tables = tuple((table.region(table.states), _table(table)) for table in found.table)
    rule = rule_of(found.on_delay_s, found.off_delay_s, is_latching=found.latching)
    return LimitRule(None, rule, tables=tables)


def _table(table: ZoneTableSettings) -> ZoneLimits:
    deadband = ZONE_DEADBAND * table.a_b if table.deadband is None else table.deadband
    return ZoneLimits.between(table.a_b, table.b_c, table.c_d, deadband)


def _clock_limit(limit: float, delay_s: float) -> LimitRule:
    """A tenth of the limit is its deadband."""
    return LimitRule(Limits(limit, deadband=limit / 10), rule_of(delay_s, delay_s))
