"""Snapshots of unit states in an analysing process, for reports through the database."""

from collections.abc import Sequence
from dataclasses import fields, replace

from core.alarms.alarm import Alarm
from core.monitor.assessment import Assessment
from service.live.live_view import LiveView, UnitStatus
from service.live.unit_state import BearingState, FilmState, UnitSigns, UnitState
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.service_alarms import reporting_unit
from service.settings.units import UnitSettings


def bearing_state(assessment: Assessment) -> BearingState:
    """Return a result of a bearing without its arrays (spectrum, orbit)."""
    names = [each.name for each in fields(BearingState)]
    return BearingState(**{name: getattr(assessment, name) for name in names})


def unit_state(
    settings: UnitSettings, live: LiveView, alarms: AlarmEngine, films: FilmMonitor
) -> UnitState:
    """Return the state of a unit: newest results, alarms, films and baseline versions in force."""
    unit, bearings = settings.id, [bearing.id for bearing in settings.bearing]
    own = alarm_state(
        [alarm for alarm in alarms.alarms if reporting_unit(alarm.identity) == unit], alarms
    )
    found = {bearing: live.assessment(unit, bearing) for bearing in bearings}
    seen = {bearing: films.newest(unit, bearing) for bearing in bearings}
    in_force = {bearing: films.baseline(unit, bearing) for bearing in bearings}
    return replace(
        own,
        bearings={b: bearing_state(result) for b, result in found.items() if result is not None},
        films={b: FilmState(news.reading, news.findings) for b, news in seen.items() if news},
        baselines={b: baseline.origin.version for b, baseline in in_force.items() if baseline},
    )


def alarm_state(own: Sequence[Alarm], alarms: AlarmEngine) -> UnitState:
    """Return a unit state that contains only the given alarms."""
    return UnitState(
        bearings={},
        alarms=tuple(own),
        judged=frozenset(a.identity.id for a in own if alarms.is_judged(a)),
        chattering=frozenset(a.identity.id for a in own if alarms.is_chattering(a)),
        films={},
        baselines={},
    )


def plant_signs(live: LiveView) -> UnitSigns:
    """Return the `UnitSigns` of the process itself: unstored findings and store error."""
    return UnitSigns(UnitStatus(), None, {}, live.n_unstored, live.store_error)


def unit_signs(settings: UnitSettings, live: LiveView) -> UnitSigns:
    """Return the `UnitSigns` of a unit: link state, and ages of samples and results."""
    unit = settings.id
    ages_s = {bearing.id: live.current(unit, bearing.id).age_s for bearing in settings.bearing}
    return UnitSigns(
        status=live.status(unit),
        data_age_s=live.data_age_s(unit),
        result_ages_s={bearing: age_s for bearing, age_s in ages_s.items() if age_s is not None},
        n_unstored=live.n_unstored,
        store_error=live.store_error,
    )
