"""From the plant file to the rules that a unit's films are watched by."""

from core.change.settings import FilmRules
from core.machine.unit import Estimator
from core.units import ns_from_s
from service.settings.bearings import BearingSettings
from service.settings.film_alarms import FilmAlarmSettings
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.units import UnitSettings


def film_rules_of(unit: UnitSettings, settings: FilmAlarmSettings) -> FilmRules | str:
    """How the films of a unit are watched, or why they cannot be."""
    if unit.power_channel is None or unit.rated_power_mw is None:
        return "operating states need power_channel and rated_power_mw"
    estimators = {
        bearing.id: watched_estimator(unit, bearing)
        for bearing in unit.bearing
        if bearing.oil_temperature is not None
    }
    if not estimators:
        return "conditions need the oil_temperature of a bearing"
    return FilmRules(
        estimators=estimators,
        grid=settings.baseline.settings().grid,
        operating=settings.operating.limits(unit.rated_speed_rpm, unit.rated_power_mw),
        change=settings.change.limits(),
        reading_ns=ns_from_s(settings.reading_period_s),
        time_lapse=settings.time_lapse,
    )


def watched_estimator(unit: UnitSettings, bearing: BearingSettings) -> Estimator:
    """Whose stiffness is compared: one and the same, so that like meets like."""
    if bearing.watched_estimator is not None:
        return bearing.watched_estimator
    if isinstance(unit.source, ModbusVectorSettings):
        return Estimator.RATIO_ORDER1  # all that amplitudes alone can give
    return bearing.preference[0]
