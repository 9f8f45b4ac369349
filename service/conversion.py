"""From the plant file's settings to the plain values that core and adapters take."""

from acquisition.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.machine import Bearing, Channel, Unit
from core.settings import AnalysisSettings
from service.settings.plant import AnalysisModel
from service.settings.units import UnitSettings


def machine_of(settings: UnitSettings) -> Unit:
    """The unit as the numerics see it."""
    return Unit(
        id=settings.id,
        rated_speed_rpm=settings.rated_speed_rpm,
        rate_hz=settings.rate_hz,
        channels=tuple(Channel(c.id, c.measurand, c.sign) for c in settings.channel),
        bearings=tuple(Bearing(**bearing.model_dump()) for bearing in settings.bearing),
        speed_channel=settings.speed_channel,
        power_channel=settings.power_channel,
    )


def calibration_of(settings: UnitSettings) -> UnitCalibration:
    """How the counts of the unit's device become engineering units."""
    return UnitCalibration(
        unit=settings.id,
        rate_hz=settings.rate_hz,
        channels=tuple(
            ChannelCalibration(c.full_scale_v, c.unit_per_v, c.ok_min_v, c.ok_max_v)
            for c in settings.channel
        ),
        slow=tuple(SlowCalibration(c.id, c.minimum, c.maximum) for c in settings.slow_channel),
    )


def analysis_of(settings: AnalysisModel) -> AnalysisSettings:
    """How samples are segmented, averaged and judged."""
    return AnalysisSettings(**settings.model_dump())
