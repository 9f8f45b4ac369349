"""Conversion of settings to the objects of the analysis: machine, calibration, alarm rules."""

from collections.abc import Sequence

from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.rules import BearingRules, LimitRule, UnitRules, rule_of
from core.alarms.statistics import ChatterRule
from core.change.settings import FilmRules
from core.checks.sensor_checks import SensorLimits
from core.limits import Limits, ZoneLimits
from core.machine.channel import Channel
from core.machine.unit import Bearing, BearingAccuracy, Estimator, GapAccuracy, Unit
from core.monitor.assessment import AnalysisSettings
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.spectra.resolution import angles_of, error_factor
from core.stiffness.dynamic_lines import DynamicSettings
from core.units import ns_from_s
from service.settings.alarms import AlarmSettings
from service.settings.bearings import BearingSettings
from service.settings.channels import ChannelSettings
from service.settings.films import FilmAlarmSettings
from service.settings.limits import (
    LIMITS,
    LimitSettings,
    TwoSidedLimitSettings,
    ZoneSettings,
    ZoneTableSettings,
    states_of,
)
from service.settings.plant import AnalysisModel, PlantFile
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import Origin
from service.settings.transducers import response_of
from service.settings.units import UnitSettings


def machine_of(settings: UnitSettings) -> Unit:
    """Return the settings of a generating unit as a `Unit`."""
    return Unit(
        **settings.values_for(Unit),
        channels=tuple(_channel(channel) for channel in settings.channel),
        bearings=tuple(_bearing(bearing, settings) for bearing in settings.bearing),
        slow_channels=tuple(filter(None, (slow.recorded for slow in settings.slow_channel))),
        rotation_sense=1 if settings.rotation == "x_to_y" else -1,
        has_vortex=settings.turbine == "francis",
    )


def _channel(settings: ChannelSettings) -> Channel:
    calibration = ChannelCalibration(**settings.scale)
    return Channel(
        id=settings.id,
        measurand=settings.measurand,
        direction=settings.sign,
        response=response_of(settings.response),
        delay_s=settings.delay_s,
        line_floor=settings.floor,
        unit_per_count=calibration.unit_per_count,
        ok_limits=calibration.ok_limits,
        probe=settings.probe or "",
        slow_roll=settings.slow_roll.vector() if settings.slow_roll else None,
        angle_deg=settings.angle_deg,
    )


def _bearing(settings: BearingSettings, unit: UnitSettings) -> Bearing:
    given = {channel.id: channel for channel in unit.channel}
    shaft, bearing = (
        [given[getattr(settings, f"{part}_{axis}")] for axis in "xy"]
        for part in ("shaft", "bearing")
    )
    grown = _error_factor(shaft)
    shaft_gain = grown * max(probe.gain_uncertainty for probe in shaft)
    values = settings.values_for(Bearing) | {"runout_um_pk": grown * settings.runout_um_pk}
    return Bearing(
        **values,
        accuracy=BearingAccuracy(
            shaft_gain=shaft_gain,
            bearing_gain=_error_factor(bearing) * max(each.gain_uncertainty for each in bearing),
            bracket_stiffness=0.0
            if settings.bracket_stiffness_n_per_m is None
            else settings.bracket_stiffness_uncertainty,
            bracket_mass=settings.bracket_mass_uncertainty,
            bracket_damping=settings.bracket_damping_uncertainty,
            delay_s=settings.delay_uncertainty_s,
            cross_coupling=settings.cross_coupling_uncertainty,
        ),
        gap_accuracy=GapAccuracy(
            gain=shaft_gain,
            reference_um=settings.gap_reference_uncertainty_um,
            growth_um=settings.thermal_growth_um,
            growth_change_um=settings.thermal_growth_change_um,
            clearance=settings.clearance_uncertainty,
        ),
    )


def _error_factor(pair: Sequence[ChannelSettings]) -> float:
    """Return the factor of the errors of two transducers when they are resolved into x and y."""
    first_deg, second_deg = angles_of(pair[0].angle_deg, pair[1].angle_deg)
    return error_factor(second_deg - first_deg)


def calibration_of(settings: UnitSettings) -> UnitCalibration:
    """Return the calibration of a unit, from counts of the device to engineering units."""
    return UnitCalibration(
        unit=settings.id,
        rate_hz=settings.rate_hz,
        channels=tuple(ChannelCalibration(**c.scale) for c in settings.channel),
        slow=tuple(SlowCalibration(c.id, c.minimum, c.maximum) for c in settings.slow_channel),
        block_samples=settings.block_samples,
    )


def analysis_of(settings: AnalysisModel) -> AnalysisSettings:
    """Return the settings of segments, averaging and estimation as `AnalysisSettings`."""
    dynamic = settings.dynamic
    noise = dynamic.probe_noise_um2_per_hz
    return AnalysisSettings(
        **settings.model_dump(exclude={"dynamic", "speed_tolerance", "max_power_change"}),
        sensors=SensorLimits(**settings.values_for(SensorLimits)),
        dynamic=DynamicSettings(
            **dynamic.model_dump(exclude={"probe_noise_um2_per_hz"}),
            probe_noise_um2_per_hz=None if noise is None else (noise, noise),
            min_segments=max(settings.min_segments, 3),
            overlap=settings.overlap,
        ),
    )


ZONE_DEADBAND = 0.05
"""Default deadband of zone boundaries, as a share of the boundary between zones A and B."""


def rules_of(unit: UnitSettings, alarms: AlarmSettings, origin: Origin) -> UnitRules:
    """Return the alarm rules of a unit.

    A replay has no rules for link and clock; a unit with ``clock = "ignored"`` has no clock rule.
    """
    is_live = origin is Origin.LIVE
    is_judged = is_live and alarms.clock == "judged"
    return UnitRules(
        channel=rule_of(alarms.channel_on_delay_s, alarms.channel_off_delay_s),
        slow_channel=rule_of(alarms.slow_channel_on_delay_s, alarms.channel_off_delay_s),
        bearings={bearing.id: _bearing_rules(bearing) for bearing in unit.bearing},
        slow_limits={s.id: rule for s in unit.slow_channel if (rule := _limits(s.limits))},
        clock_offset=_clock_limit(alarms.max_clock_offset_s, 30.0) if is_judged else None,
        clock_drift=_clock_limit(alarms.max_clock_drift_ppm, 60.0) if is_judged else None,
        time_stamps=rule_of(0.0, 600.0) if is_judged else None,
        link=rule_of(alarms.link_lost_after_s, 0.0) if is_live else None,
    )


def chatter_rule_of(alarms: AlarmSettings) -> ChatterRule:
    """Return the rule that classifies alarms as chattering."""
    return ChatterRule(alarms.chattering_activations, ns_from_s(alarms.chattering_window_s))


def references_of(unit: UnitSettings) -> list[VectorReference]:
    """Return the 1× reference vectors of a unit, one entry for each bearing and operating state.

    The list is empty if the plant file has none.
    """
    return [
        VectorReference(unit.id, bearing.id, state, vectors)
        for bearing in unit.bearing
        for reference in bearing.alarms.order1_reference
        for vectors in [{at: OrderVector(*vector) for at, vector in reference.vectors().items()}]
        for state in states_of(reference.states)
    ]


def _bearing_rules(bearing: BearingSettings) -> BearingRules:
    alarms, zones = bearing.alarms, bearing.alarms.zones
    return {
        "shaft_order1": _limits(alarms.shaft_order1_um_pk),
        "oil_temperature": _limits(alarms.oil_temperature_c),
        "pad_temperatures": _limits(alarms.pad_temperature_excess_k),
        "shaft_overall": _limits(alarms.shaft_overall_um_pp),
        "bearing_overall": _limits(alarms.bearing_overall_mm_s_rms),
        "eccentricity": _limits(alarms.eccentricity_ratio),
        "gap": _limits(alarms.gap_um),
        "shaft_change": _limits(alarms.shaft_order1_change_um_pk),
        "bearing_change": _limits(alarms.bearing_order1_change_um_pk),
        "shaft_zones": _zones(zones.shaft_um_pp),
        "orbit_zones": _zones(zones.shaft_max_um_pk),
        "bearing_zones": _zones(zones.bearing_mm_s_rms),
    }


def _limits(found: LimitSettings | None) -> LimitRule | None:
    if found is None:
        return None
    rule = rule_of(found.on_delay_s, found.off_delay_s, is_latching=found.latching)
    tables = tuple(
        (table.region(found.states), _values(found.within(table))) for table in found.table
    )
    return LimitRule(_values(found), rule, states_of(found.states), tables)


def _values(found: LimitSettings) -> Limits:
    if isinstance(found, TwoSidedLimitSettings):
        return Limits(**found.model_dump(include=set(LIMITS)))
    return Limits(found.alert, found.danger, found.deadband)


def _zones(found: ZoneSettings | None) -> LimitRule | None:
    if found is None:
        return None
    tables = tuple((table.region(table.states), _table(table)) for table in found.table)
    rule = rule_of(found.on_delay_s, found.off_delay_s, is_latching=found.latching)
    return LimitRule(None, rule, tables=tables)


def _table(table: ZoneTableSettings) -> ZoneLimits:
    deadband = ZONE_DEADBAND * table.a_b if table.deadband is None else table.deadband
    return ZoneLimits(table.b_c, table.c_d, deadband, zone_b=table.a_b)


def _clock_limit(limit: float, delay_s: float) -> LimitRule:
    """Return a limit rule of the device clock, with a deadband of a tenth of the limit."""
    return LimitRule(Limits(limit, deadband=limit / 10), rule_of(delay_s, delay_s))


def film_rules_of(unit: UnitSettings, settings: FilmAlarmSettings) -> FilmRules | str:
    """Return the film rules of a unit, or the reason why its films cannot be monitored."""
    if unit.power_channel is None or unit.rated_power_mw is None:
        return "operating states require power_channel and rated_power_mw"
    estimators = {
        bearing.id: watched_estimator(unit, bearing)
        for bearing in unit.bearing
        if bearing.oil_temperature is not None
    }
    if not estimators:
        return "operating conditions require oil_temperature of at least one bearing"
    return FilmRules(
        estimators=estimators,
        grid=settings.baseline.settings().grid,
        operating=settings.operating.limits(unit.rated_speed_rpm, unit.rated_power_mw),
        change=settings.change.limits(),
        reading_ns=ns_from_s(settings.reading_period_s),
        time_lapse=settings.time_lapse,
        change_ck=settings.change_ck.limits(),
    )


def watched_estimator(unit: UnitSettings, bearing: BearingSettings) -> Estimator:
    """Return the estimator whose stiffness is compared with the baseline of a bearing."""
    if bearing.watched_estimator is not None:
        return bearing.watched_estimator
    if isinstance(unit.source, ModbusVectorSettings):
        return Estimator.RATIO_ORDER1  # the only estimator that requires no phase
    return bearing.preference[0]


STALE_HOPS = 2.5
"""Age of a result in refresh periods above which the result is stale."""


def refresh_s(plant: PlantFile) -> float:
    """Return the interval between results, in s, of the unit for which it is longest."""
    hop_samples = analysis_of(plant.analysis).hop_samples
    return max(
        (unit.source.hop_polls if isinstance(unit.source, ModbusVectorSettings) else hop_samples)
        / unit.sampling_hz
        for unit in plant.unit
    )


def stale_after_s(plant: PlantFile) -> float:
    """Return the age above which a result of a plant is stale, s."""
    return STALE_HOPS * refresh_s(plant)
