"""From the plant file's settings to the rules of a unit."""

from core.alarms.limits import Limits
from core.alarms.rules import BearingRules, ClockRules, LimitRule, UnitRules, rule_of
from service.origin import Origin
from service.settings.alarms import (
    AlarmSettings,
    AmplitudeLimitSettings,
    TemperatureLimitSettings,
)
from service.settings.bearings import BearingSettings
from service.settings.units import UnitSettings

CLOCK_DELAYS_S = {"offset": 30.0, "drift": 60.0}


def rules_of(unit: UnitSettings, alarms: AlarmSettings, origin: Origin) -> UnitRules:
    """What is watched on a unit; of a replay neither the link nor the clock."""
    is_live = origin is Origin.LIVE
    return UnitRules(
        channel=rule_of(alarms.channel_on_delay_s, alarms.channel_off_delay_s),
        slow_channel=rule_of(alarms.slow_channel_on_delay_s, alarms.channel_off_delay_s),
        bearings={bearing.id: _bearing(bearing) for bearing in unit.bearing},
        clock=_clock(alarms) if is_live and alarms.clock == "judged" else None,
        link=rule_of(alarms.link_lost_after_s, 0.0) if is_live else None,
    )


def _bearing(bearing: BearingSettings) -> BearingRules:
    return BearingRules(
        shaft_order1=_limits(bearing.alarms.shaft_order1_um_pk),
        oil_temperature=_limits(bearing.alarms.oil_temperature_c),
    )


def _limits(found: AmplitudeLimitSettings | TemperatureLimitSettings | None) -> LimitRule | None:
    if found is None:
        return None
    limits = Limits(found.alert, found.danger, found.deadband)
    return LimitRule(limits, rule_of(found.on_delay_s, found.off_delay_s))


def _clock(alarms: AlarmSettings) -> ClockRules:
    return ClockRules(
        offset=_clock_limit(alarms.max_clock_offset_s, CLOCK_DELAYS_S["offset"]),
        drift=_clock_limit(alarms.max_clock_drift_ppm, CLOCK_DELAYS_S["drift"]),
    )


def _clock_limit(limit: float, delay_s: float) -> LimitRule:
    """A tenth of the limit is its deadband."""
    return LimitRule(Limits(limit, deadband=limit / 10), rule_of(delay_s, delay_s))
