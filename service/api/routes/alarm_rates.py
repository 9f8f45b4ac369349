"""How often alarms come."""

import asyncio
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from core.alarms.alarm import PLANT
from core.alarms.statistics import AlarmFigures, ChatterRule, figures_of, stale_alarms
from core.limits import AlarmLevel
from core.units import DAY_NS
from service.api.auth.declared import Reach, needs
from service.api.context import Context, FilmBoard
from service.api.parameters import Moment, ns_from_datetime, require_order
from service.api.problems import ProblemError, described_problems
from service.api.routes.alarm_models import (
    LEVEL_NAMES,
    AlarmIdText,
    AlarmLevelName,
    AlarmModel,
    alarm_model,
)
from service.api.values import ApiModel, Time
from service.live.alarm_board import AlarmBoard
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.port import AlarmQuery, Store

UnitKey = Annotated[str, Field(examples=["U1"])]


class FrequentModel(ApiModel):
    """A frequent alarm."""

    alarm: AlarmIdText
    """Alarm."""

    n_alarms: int
    """Number of announcements."""

    share: float
    """Share of all announcements."""


class AlarmFiguresModel(ApiModel):
    """Figures of an alarm list after ISA-18.2."""

    n_alarms: int
    """Number of announcements: raised, risen to danger, or shown again after being hidden."""

    per_day: Annotated[float, Field(examples=[3.4])]
    """Mean number of alarms per day."""

    per_10_min: Annotated[float, Field(examples=[0.02])]
    """Mean number of alarms in ten minutes."""

    most_in_10_min: int
    """Largest number of alarms in ten minutes."""

    share_in_flood: float
    """Share of the ten-minute periods with more than ten alarms."""

    n_by_level: dict[AlarmLevelName, int]
    """Number of alarms by priority."""

    share_by_level: dict[AlarmLevelName, float]
    """Share of alarms by priority; 0 without alarms."""

    most_frequent: list[FrequentModel]
    """At most ten, the most frequent first."""

    chattering: dict[AlarmIdText, int]
    """Number of times each alarm was raised in bursts that the plant file defines as chattering."""

    n_fleeting: int
    """Alarms that returned within chattering_window_s."""


class AlarmRatesModel(ApiModel):
    """Rates of alarms in a time range, and alarms active for more than a day."""

    start: Time
    """Start of the range; later than requested if there were too many events to read."""

    end: Time
    """End of the range."""

    is_complete: bool
    """Whether all events of the requested range were counted."""

    all: AlarmFiguresModel
    """Figures of all requested units."""

    units: dict[UnitKey, AlarmFiguresModel]
    """Figures of each unit, and of "plant" for alarms about the service itself."""

    stale: list[AlarmModel]
    """Alarms active for more than a day, oldest first."""


MAX_RATED = 100_000
"""Maximum number of events counted in one request."""


@dataclass(frozen=True)
class Counted:
    """Figures of a time range.

    Parameters
    ----------
    start_ns, end_ns
        Range that was counted; it starts later than requested if there were too many events.
    """

    start_ns: int
    end_ns: int
    is_complete: bool
    all: AlarmFigures
    units: Mapping[str, AlarmFigures]


def counted(store: Store, wanted: AlarmQuery, units: Sequence[str], rule: ChatterRule) -> Counted:
    """Count stored events; a hundred thousand take seconds, so call it in a thread.

    Parameters
    ----------
    wanted
        Unit, start and end.
    units
        Units to report, also those without events.

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
    """Return figures, and the stale alarms of the shown units."""
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


DEFAULT_DAYS, MAX_DAYS = 7, 400

RATE_PROBLEMS = described_problems(
    {404: "Unknown unit", 422: "A wrong parameter", 503: "The store cannot be read"}
)


def alarm_rate_router(context: Context) -> APIRouter:
    """Return the route of alarm rates."""
    router = APIRouter(
        prefix="/api/v1/alarms", tags=["alarms"], dependencies=[needs(Permission.READ, Reach.ASKED)]
    )

    @router.get("/rates", summary="How often alarms come", responses=RATE_PROBLEMS)
    async def rates(
        unit: Annotated[
            str | None,
            Query(max_length=32, description="Only this unit.", examples=["U1"]),
        ] = None,
        start: Annotated[
            Moment | None,
            Query(
                description="Start of the range; default: seven days before its end.",
                examples=["2026-11-14T09:00:00Z"],
            ),
        ] = None,
        end: Annotated[
            Moment | None,
            Query(description="End of the range; default: now.", examples=["2026-11-21T09:00:00Z"]),
        ] = None,
    ) -> AlarmRatesModel:
        """Count alarms per ten minutes and per day; name frequent, chattering and stale alarms.

        The counts are of stored events, by unit and for the whole plant, over at most 400 days.
        """
        now_ns = context.clock.now_ns()
        end_ns = ns_from_datetime(end, "end") if end else now_ns
        default_ns = max(end_ns - DEFAULT_DAYS * DAY_NS, 0)
        start_ns = ns_from_datetime(start, "start") if start else default_ns
        _check_span(start_ns, end_ns)
        if unit not in (None, PLANT):
            context.unit(unit)
        units = list(context.units) if unit is None else [unit]
        wanted = AlarmQuery(unit=unit, start_ns=start_ns, end_ns=end_ns)
        rule = context.alarms.chatter_rule
        found = await asyncio.to_thread(counted, context.store, wanted, units, rule)
        shown = {*units, PLANT} if unit is None else {unit}
        return alarm_rates_model(context.alarms, context.films, found, shown, now_ns)

    return router


def _check_span(start_ns: int, end_ns: int) -> None:
    require_order(start_ns, end_ns)
    if end_ns - start_ns > MAX_DAYS * DAY_NS:
        days = (end_ns - start_ns) / DAY_NS
        detail = f"the range has {days:g} days; the maximum is {MAX_DAYS} days"
        raise ProblemError(422, "Wrong parameter", detail, "start")
