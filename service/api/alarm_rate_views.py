"""Alarm rates in the words of the API."""

from collections.abc import Sequence

from core.alarms.alarm import PLANT, AlarmLevel
from core.alarms.event import AlarmEvent
from core.alarms.figures import AlarmFigures, figures_of, stale_alarms
from service.alarms.engine import AlarmEngine
from service.api.alarm_rate_models import AlarmFiguresModel, AlarmRatesModel, FrequentModel
from service.api.alarm_views import LEVEL_NAMES, alarm_model
from service.api.times import rfc3339
from service.films.keeper import FilmKeeper
from service.store.port import AlarmQuery, Store

MAX_RATED = 100_000
"""Most events that are counted at once."""


def rated_events(store: Store, unit: str | None, start_ns: int, end_ns: int) -> list[AlarmEvent]:
    """The newest events of some time, oldest first; one more than are counted if there are more.

    Raises
    ------
    StoreError
        If they cannot be read.
    """
    query = AlarmQuery(limit=MAX_RATED + 1, unit=unit, start_ns=start_ns, end_ns=end_ns)
    return [stored.event for stored in reversed(store.alarm_events(query))]


def alarm_rates_model(
    engine: AlarmEngine,
    films: FilmKeeper,
    events: Sequence[AlarmEvent],
    span: tuple[int, int],
    units: Sequence[str],
    now_ns: int,
) -> AlarmRatesModel:
    """Figures of some events.

    Parameters
    ----------
    events
        From `rated_events`.
    span
        Time that was asked for.
    units
        That figures are wanted of.
    """
    start_ns, end_ns = span
    is_complete = len(events) <= MAX_RATED
    if not is_complete:
        start_ns = min(events[0].time_ns + 1, end_ns - 1)
    rule = engine.chatter_rule
    by_unit = {
        unit: [event for event in events if event.identity.unit == unit]
        for unit in dict.fromkeys((*units, PLANT))
    }
    stale = [a for a in stale_alarms(engine.alarms, now_ns) if a.identity.unit in by_unit]
    return AlarmRatesModel(
        start=rfc3339(start_ns),
        end=rfc3339(end_ns),
        is_complete=is_complete,
        all=_figures_model(figures_of(events, start_ns, end_ns, rule)),
        units={
            unit: _figures_model(figures_of(own, start_ns, end_ns, rule))
            for unit, own in by_unit.items()
            if unit in units or own
        },
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
