"""From the plant file's settings to the plain values that core and adapters take."""

from core.checks.sensor_checks import SensorLimits
from core.machine.channel import Channel
from core.machine.unit import Bearing, BearingAccuracy, GapAccuracy, Unit
from core.monitor.assessment import AnalysisSettings
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.stiffness.dynamic_lines import DynamicSettings
from service.settings.bearings import BearingSettings
from service.settings.channels import ChannelSettings
from service.settings.plant import AnalysisModel
from service.settings.response import response_of
from service.settings.units import UnitSettings

ACCURACY_KEYS = {
    "bracket_stiffness_uncertainty",
    "bracket_mass_uncertainty",
    "bracket_damping_uncertainty",
    "cross_coupling_uncertainty",
    "delay_uncertainty_s",
    "gap_reference_uncertainty_um",
    "thermal_growth_um",
    "thermal_growth_change_um",
    "clearance_uncertainty",
}
"""Keys of a bearing that say how well something is known."""


def machine_of(settings: UnitSettings) -> Unit:
    """The unit as the numerics see it."""
    return Unit(
        id=settings.id,
        rated_speed_rpm=settings.rated_speed_rpm,
        rate_hz=settings.rate_hz,
        channels=tuple(_channel(channel) for channel in settings.channel),
        bearings=tuple(_bearing(bearing, settings) for bearing in settings.bearing),
        speed_channel=settings.speed_channel,
        power_channel=settings.power_channel,
        rotation_sense=1 if settings.rotation == "x_to_y" else -1,
        has_vortex=settings.turbine == "francis",
        key_phase=settings.key_phase,
        rated_power_mw=settings.rated_power_mw,
    )


def _channel(settings: ChannelSettings) -> Channel:
    calibration = _calibration(settings)
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
        slow_roll=settings.slow_roll.vector(settings.id) if settings.slow_roll else None,
    )


def _calibration(settings: ChannelSettings) -> ChannelCalibration:
    return ChannelCalibration(**settings.scale)


def _bearing(settings: BearingSettings, unit: UnitSettings) -> Bearing:
    return Bearing(
        **settings.model_dump(exclude=ACCURACY_KEYS | {"alarms", "watched_estimator"}),
        accuracy=_accuracy(settings, unit),
        gap_accuracy=_gap_accuracy(settings, unit),
    )


def _gap_accuracy(settings: BearingSettings, unit: UnitSettings) -> GapAccuracy:
    gain = _gains(unit)
    return GapAccuracy(
        gain=max(gain[settings.shaft_x], gain[settings.shaft_y]),
        reference_um=settings.gap_reference_uncertainty_um,
        growth_um=settings.thermal_growth_um,
        growth_change_um=settings.thermal_growth_change_um,
        clearance=settings.clearance_uncertainty,
    )


def _gains(unit: UnitSettings) -> dict[str, float]:
    return {channel.id: channel.gain_uncertainty for channel in unit.channel}


def _accuracy(settings: BearingSettings, unit: UnitSettings) -> BearingAccuracy:
    """The worse of two transducers stands for both directions."""
    gain = _gains(unit)
    return BearingAccuracy(
        shaft_gain=max(gain[settings.shaft_x], gain[settings.shaft_y]),
        bearing_gain=max(gain[settings.bearing_x], gain[settings.bearing_y]),
        bracket_stiffness=settings.bracket_stiffness_uncertainty,
        bracket_mass=settings.bracket_mass_uncertainty,
        bracket_damping=settings.bracket_damping_uncertainty,
        delay_s=settings.delay_uncertainty_s,
        cross_coupling=settings.cross_coupling_uncertainty,
    )


def calibration_of(settings: UnitSettings) -> UnitCalibration:
    """How the counts of the unit's device become engineering units."""
    return UnitCalibration(
        unit=settings.id,
        rate_hz=settings.rate_hz,
        channels=tuple(_calibration(c) for c in settings.channel),
        slow=tuple(SlowCalibration(c.id, c.minimum, c.maximum) for c in settings.slow_channel),
        block_samples=settings.block_samples,
    )


def analysis_of(settings: AnalysisModel) -> AnalysisSettings:
    """How samples are segmented, averaged and judged."""
    dynamic = settings.dynamic
    noise = dynamic.probe_noise_um2_per_hz
    return AnalysisSettings(
        **settings.model_dump(exclude={"dynamic", "speed_tolerance", "max_power_change"}),
        sensors=SensorLimits(
            speed_tolerance=settings.speed_tolerance, max_power_change=settings.max_power_change
        ),
        dynamic=DynamicSettings(
            band_hz=dynamic.band_hz,
            guard_bins=dynamic.guard_bins,
            probe_noise_um2_per_hz=None if noise is None else (noise, noise),
            quiet_band_hz=dynamic.quiet_band_hz,
            min_segments=max(settings.min_segments, 3),
            max_relative_uncertainty=dynamic.max_relative_uncertainty,
            overlap=settings.overlap,
        ),
    )
