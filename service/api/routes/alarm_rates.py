"""Routes for the alarm system: figures such as alarms per day, and delivery of messages."""

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from core.alarms.alarm import PLANT, AlarmEvent
from core.alarms.statistics import figures_of, stale_alarms
from core.limits import AlarmLevel
from core.units import DAY_NS
from service.api.auth.gate import GuardedRouter, Reach, needs, subject_router
from service.api.context import Context
from service.api.parameters import Moment, OnlyUnit, ns_from_datetime, parameter, require_order
from service.api.problems import ProblemError, problem_responses
from service.api.routes.alarm_models import AlarmIdText, AlarmModel, alarm_model
from service.api.values import ApiModel, Time
from service.live.receivers import ReceiverView
from service.settings.alarm_kinds import LEVEL_NAMES, AlarmLevelName
from service.settings.storage import Origin
from service.store.access.identities import Permission
from service.store.port import AlarmQuery

UnitKey = Annotated[str, Field(examples=["U1"])]


class FrequentModel(ApiModel):
    """Frequently announced alarm, with its number of announcements."""

    alarm: AlarmIdText

    n_alarms: int
    """Number of announcements of the alarm."""

    share: float
    """Fraction of all announcements, 0 to 1."""


class AlarmFiguresModel(ApiModel):
    """Performance figures of an alarm list according to ISA-18.2."""

    n_alarms: int
    """Number of announcements: alarms raised, risen to danger, or active when no longer hidden."""

    per_day: Annotated[float, Field(examples=[3.4])]
    """Mean number of announcements per day."""

    most_in_10_min: int
    """Largest number of announcements in ten minutes."""

    share_in_flood: float
    """Fraction of the ten-minute periods with more than ten announcements, 0 to 1."""

    n_by_level: dict[AlarmLevelName, int]
    """Number of announcements by level of the alarm."""

    most_frequent: list[FrequentModel]
    """Alarms with the most announcements, at most ten, in descending order."""

    chattering: dict[AlarmIdText, int]
    """Number of times each alarm was raised while chattering; the plant file defines chattering."""

    n_fleeting: int
    """Number of alarms that returned to normal within ``chattering_window_s`` of the plant file."""


class AlarmRatesModel(ApiModel):
    """Alarm performance figures in a time range, and alarms active for more than a day."""

    start: Time
    """Start of the counted range; later than requested if there are too many events."""

    end: Time
    """End of the range."""

    is_complete: bool
    """Whether all events of the requested range were counted."""

    all: AlarmFiguresModel
    """Performance figures of all requested units together."""

    units: dict[UnitKey, AlarmFiguresModel]
    """Performance figures by unit; "plant" for alarms about the service itself."""

    stale: list[AlarmModel]
    """Alarms active for more than a day, oldest first."""


class DeliveryModel(ApiModel):
    """State of all receivers of alarm messages; a replay sends no messages."""

    origin: Origin

    receivers: list[ReceiverView]
    """Receivers in the order of the plant file, then receivers that are no longer in it."""


MAX_RATED = 100_000
"""Maximum number of events that are counted for one request."""


def counted(context: Context, units: Sequence[str], query: AlarmQuery) -> dict[str, object]:
    """Return the fields of `AlarmRatesModel` except `stale`, from the stored alarm events.

    `units` are the units to report, also of units without events; `query` has unit, start and end
    of the events. The function takes seconds for 100,000 events: call it in a thread.

    Raises `StoreError` if the events cannot be read.
    """
    newest_first = context.store.alarm_events(replace(query, limit=MAX_RATED + 1))
    events = [stored.event for stored in reversed(newest_first)]
    start_ns, end_ns, is_complete = query.start_ns, query.end_ns, len(events) <= MAX_RATED
    if not is_complete:
        start_ns = min(events[0].time_ns + 1, end_ns - 1)
    about_plant = [PLANT] if any(event.identity.unit == PLANT for event in events) else []
    names = dict.fromkeys([*units, *about_plant])

    def figures(some: Iterable[AlarmEvent]) -> AlarmFiguresModel:
        found = figures_of(some, start_ns, end_ns, context.alarms.chatter_rule)
        n_by_level = {LEVEL_NAMES[level]: found.n_by_level[level] for level in AlarmLevel}
        return AlarmFiguresModel.of(found, n_by_level=n_by_level)

    return {
        "start": start_ns,
        "end": end_ns,
        "is_complete": is_complete,
        "all": figures(events),
        "units": {n: figures(e for e in events if e.identity.unit == n) for n in names},
    }


DEFAULT_DAYS, MAX_DAYS = 7, 400

START = "Start of the range; default: seven days before its end.", "2026-11-14T09:00:00Z"
END = "End of the range; default: now.", "2026-11-21T09:00:00Z"


def alarm_rate_router(context: Context) -> GuardedRouter:
    """Return the router for alarm performance figures, and for the delivery of messages."""
    router = subject_router("", "alarms", reach=Reach.ASKED)

    @router.get("/alarms/rates", responses=problem_responses(404))
    async def alarm_rates(
        unit: OnlyUnit = None,
        start: Annotated[Moment | None, parameter(*START)] = None,
        end: Annotated[Moment | None, parameter(*END)] = None,
    ) -> AlarmRatesModel:
        """Count alarms per ten minutes and day; list frequent, chattering and long-active alarms.

        The numbers are given by unit and for all units together, over at most 400 days.
        """
        now_ns = context.clock.now_ns()
        end_ns = ns_from_datetime(end, "end") if end else now_ns
        default_ns = max(end_ns - DEFAULT_DAYS * DAY_NS, 0)
        start_ns = ns_from_datetime(start, "start") if start else default_ns
        require_order(start_ns, end_ns)
        if end_ns - start_ns > MAX_DAYS * DAY_NS:
            days = (end_ns - start_ns) / DAY_NS
            detail = f"the range is {days:g} days long; the maximum is {MAX_DAYS} days"
            raise ProblemError(422, "Wrong parameter", detail, "start")
        if unit not in (None, PLANT):
            context.unit(unit)
        units = list(context.units) if unit is None else [unit]
        query = AlarmQuery(unit=unit, start_ns=start_ns, end_ns=end_ns)
        found = await asyncio.to_thread(counted, context, units, query)
        shown = {*units, PLANT} if unit is None else {unit}
        stale = [a for a in stale_alarms(context.alarms.alarms, now_ns) if a.identity.unit in shown]
        return AlarmRatesModel.of(stale=[alarm_model(context, a) for a in stale], **found)

    @router.get("/delivery", dependencies=[needs(Permission.READ, Reach.NO_UNIT)])
    async def message_receivers() -> DeliveryModel:
        """List the receivers of alarm messages with their waiting and failed messages."""
        return DeliveryModel.of(context, receivers=await context.receivers())

    return router
