"""Alarm rates in the words of the API."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from core.alarms.alarm import PLANT
from core.alarms.statistics import AlarmFigures, ChatterRule, figures_of, stale_alarms
from core.limits import AlarmLevel
from service.api.alarm_rate_models import AlarmFiguresModel, AlarmRatesModel, FrequentModel
from service.api.alarm_views import LEVEL_NAMES, alarm_model
from service.api.ports import FilmBoard
from service.live.alarm_board import AlarmBoard
from service.runtime.times import rfc3339
from service.store.port import AlarmQuery, Store

MAX_RATED = 100_000
"""Most events that are counted at once."""


@dataclass(frozen=True)
class Counted:
    """Figures of some time.

    Parameters
    ----------
    start_ns, end_ns
        What was counted; later than asked for if there was too much to read.
    """

    start_ns: int
    end_ns: int
    is_complete: bool
    all: AlarmFigures
    units: Mapping[str, AlarmFigures]


def counted(store: Store, wanted: AlarmQuery, units: Sequence[str], rule: ChatterRule) -> Counted:
    """Count stored events; with a hundred thousand of them that takes seconds: for a thread.

    Parameters
    ----------
    wanted
        Unit, start and end.
    units
        That figures are wanted of, whether anything has happened there or not.

    Raises
    ------
    StoreError
        If the events cannot be read.
    """
    newest_first = store.alarm_events(replace(wanted, limit=MAX_RATED + 1))
    events = [stored.event for stored in reversed(newest_first)]
    is_complete = len(events) <= MAX_RATED
    start_ns, end_ns = wanted.start_ns, wanted.end_ns
    if not is_complete:
        start_ns = min(events[0].time_ns + 1, end_ns - 1)
    found = {event.identity.unit for event in events}
    names = [*units, *([PLANT] if PLANT in found and PLANT not in units else [])]
    return Counted(
        start_ns,
        end_ns,
        is_complete,
        figures_of(events, start_ns, end_ns, rule),
        {
            unit: figures_of((e for e in events if e.identity.unit == unit), start_ns, end_ns, rule)
            for unit in names
        },
    )


def alarm_rates_model(
    engine: AlarmBoard, films: FilmBoard, found: Counted, shown: Collection[str], now_ns: int
) -> AlarmRatesModel:
    """Figures with what is stale now of the units that are shown."""
    stale = [a for a in stale_alarms(engine.alarms, now_ns) if a.identity.unit in shown]
    return AlarmRatesModel(
        start=rfc3339(found.start_ns),
        end=rfc3339(found.end_ns),
        is_complete=found.is_complete,
        all=_figures_model(found.all),
        units={unit: _figures_model(figures) for unit, figures in found.units.items()},
        stale=[alarm_model(engine, films, alarm) for alarm in stale],
    )


def _figures_model(figures: AlarmFigures) -> AlarmFiguresModel:
    return AlarmFiguresModel(
        n_alarms=figures.n_alarms,
        per_day=figures.per_day,
        per_10_min=figures.per_10_min,
        most_in_10_min=figures.most_in_10_min,
        share_in_flood=figures.share_in_flood,
        n_by_level={LEVEL_NAMES[level]: figures.n_by_level[level] for level in AlarmLevel},
        share_by_level={
            LEVEL_NAMES[level]: figures.n_by_level[level] / max(figures.n_alarms, 1)
            for level in AlarmLevel
        },
        most_frequent=[FrequentModel(**vars(entry)) for entry in figures.most_frequent],
        chattering=dict(figures.chattering),
        n_fleeting=figures.n_fleeting,
    )
