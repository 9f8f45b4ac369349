"""Routes for the alarm list, alarm events, and operations on alarms."""

import asyncio
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Annotated, Any

from fastapi import Depends, Path, Request, Response
from pydantic import Field

from core.alarms import operation
from core.limits import AlarmLevel
from core.units import ns_from_s
from service.api.answers import rendered
from service.api.auth.backoff import TokenBucket
from service.api.auth.gate import GuardedRouter, Reach, actor_or, identity_of, needs, subject_router
from service.api.context import Context
from service.api.parameters import (
    Attitude,
    Eccentricity,
    OilTemperature,
    OnlyUnit,
    OptionalTimeRange,
    States,
    at_most,
    only,
    parameter,
)
from service.api.problems import ProblemError, problem_responses
from service.api.routes.alarm_models import (
    AlarmEventModel,
    AlarmEventsModel,
    AlarmListModel,
    AlarmModel,
    RaisedAtModel,
    alarm_list_model,
    alarm_list_revision,
    alarm_model,
    event_model,
)
from service.api.tables import Column, Format, column_of, table_content, table_response
from service.api.values import ActorModel, NoteText, ReasonModel, ReasonText, states_named
from service.settings.alarm_kinds import AlarmKindName, AlarmLevelName
from service.store.access.identities import Permission
from service.store.port import AlarmQuery


class AcknowledgeModel(ActorModel):
    """Request to acknowledge an occurrence of an alarm."""

    occurrence: Annotated[int, Field(ge=1, le=10**15, examples=[3])]
    """Number of the occurrence to acknowledge; later occurrences remain unacknowledged."""

    comment: NoteText = ""
    """Comment, at most 500 printable characters."""


class CommentModel(ActorModel):
    """Request to add a comment to an alarm."""

    text: ReasonText
    """Comment, 1 to 500 printable characters."""


class ShelveModel(ReasonModel):
    """Request to shelve an alarm for a limited time."""

    duration_s: Annotated[float, Field(ge=1.0, le=31_536_000.0, examples=[3600.0])]
    """Duration of the shelving, s; the plant file sets the maximum."""


def event_table(rows: Sequence[AlarmEventModel]) -> list[Column]:
    """Return alarm events as table columns: ``time_utc``, and columns named as the JSON fields."""
    times = Column("time_utc", "time", [row.time for row in rows])
    flat = [name for name in AlarmEventModel.model_fields if name not in ("time", "raised_at")]
    points = [name for name in RaisedAtModel.model_fields if name != "cell"]
    at = [row.raised_at for row in rows]
    return [
        times,
        *(column_of(AlarmEventModel, name, [getattr(e, name) for e in rows]) for name in flat),
        *(column_of(RaisedAtModel, n, [e and getattr(e, n) for e in at]) for n in points),
    ]


MAX_EVENTS = 1000

N_COMMENTS = 30
S_PER_COMMENT = 10.0
"""Rate limit of comments per person or key: `N_COMMENTS` at once, then one per `S_PER_COMMENT`, s.

Comments are limited because they are never deleted."""

AlarmId = Annotated[
    str,
    Path(
        description="Identifier of an alarm: unit, subject and kind.",
        max_length=128,
        examples=["U1:ujb_shaft_x:channel_not_ok"],
    ),
]


async def chosen_alarms(
    eccentricity: Eccentricity,
    oil_temperature: OilTemperature,
    attitude: Attitude,
    unit: OnlyUnit = None,
    subject: Annotated[str | None, only("bearing or other subject", "LJB", 64)] = None,
    kind: Annotated[AlarmKindName | None, only("kind", "film_stiffness")] = None,
    level: Annotated[AlarmLevelName | None, only("level", "danger")] = None,
    state: States = None,
) -> AlarmQuery:
    """Return the query for alarms from the checked query parameters."""
    return AlarmQuery(
        unit=unit,
        subject=subject,
        kind=kind,
        level=None if level is None else AlarmLevel[level.upper()],
        states=states_named(state),
        eccentricity_ratio=eccentricity,
        oil_temperature_c=oil_temperature,
        attitude_deg=attitude,
    )


ChosenAlarms = Annotated[AlarmQuery, Depends(chosen_alarms)]

OUTAGE = [needs(Permission.CHANGE_MEASURING)]
"""Permission to take an alarm out of service; the alarm then sends no messages."""

UNKNOWN = {404: "Unknown alarm"}
ACTION_PROBLEMS = problem_responses(409, own=UNKNOWN)
COMMENT_LIMIT = problem_responses(
    own={429: "Too many comments; Retry-After gives the time to wait"}
)


class Allowances(dict[str, TokenBucket]):
    """Rate limit of comments or notes: a token bucket per person or key."""

    def take(self, request: Request, now_s: float) -> None:
        """Take a token of the caller; raise a problem of status 429 if no token is left.

        `now_s` is the monotonic time, s.
        """
        new = TokenBucket(N_COMMENTS, S_PER_COMMENT, now_s)
        if not self.setdefault(identity_of(request).actor, new).take(now_s):
            detail = f"too many comments; try again after {S_PER_COMMENT:g} s"
            wait = {"Retry-After": f"{S_PER_COMMENT:.0f}"}
            raise ProblemError(429, "Wait", detail, headers=wait)


def alarm_router(context: Context) -> GuardedRouter:
    """Return the router that reads alarms; it must follow other routers for ``/alarms/...``."""
    router = subject_router("/alarms", "alarms")
    revision = alarm_list_revision(context)

    @router.get("", response_model=AlarmListModel)
    async def alarms(
        request: Request,
        chosen: ChosenAlarms,
        acknowledged: Annotated[
            bool | None, parameter("Only alarms that are acknowledged, or are not.", False)
        ] = None,
    ) -> Response:
        """List alarms that are not normal, most urgent first; then those of unknown condition.

        The parameters select alarms; operating state, eccentricity, attitude angle and oil
        temperature are those at which an alarm was raised. `count` is that of the whole plant.
        """
        make = partial(alarm_list_model, context, chosen, acknowledged)
        return await context.answers.of(request, revision, make, is_polled=True)

    @router.get(
        "/events",
        response_model=AlarmEventsModel,
        responses=table_content("History of all alarms"),
        dependencies=[needs(Permission.READ, Reach.ASKED)],
    )
    async def alarm_history(
        query: Annotated[AlarmQuery, Depends(event_query)], wanted: Format
    ) -> Response:
        """List events of all alarms, newest first, in pages.

        Operating state, eccentricity, attitude angle and oil temperature select alarms by the
        operating condition in which they were raised.

        As CSV or Parquet: one row per event.
        """

        def read() -> AlarmEventsModel:
            found = context.store.alarm_events(replace(query, limit=query.limit + 1))
            page = found[: query.limit]
            events = [event_model(stored, context.films.grid) for stored in page]
            next_before = page[-1].id if len(found) > query.limit else None
            return AlarmEventsModel.of(context, events=events, next_before=next_before)

        if wanted == "json":
            return await rendered(read)
        found = await asyncio.to_thread(read)
        columns = await asyncio.to_thread(event_table, found.events)
        return table_response(wanted, columns, "alarm-events", found.next_before)

    @router.get("/{alarm}", responses=problem_responses(own=UNKNOWN))
    async def one_alarm(alarm: AlarmId) -> AlarmModel:
        """Return one alarm, also if it is normal, with its value and limit."""
        return alarm_model(context, context.alarms.alarm(alarm))

    return router


def operation_router(context: Context) -> GuardedRouter:
    """Return the router for operations on alarms; each operation returns the changed alarm."""
    router = subject_router("/alarms/{alarm}", "alarms", Permission.ACT_ON_ALARMS)
    allowances = Allowances()

    async def done(
        id_: str, asked: ActorModel, kind: type[operation.Action], **more: object
    ) -> AlarmModel:
        """Execute an operation with the fields of a request; return the alarm once it is stored."""
        given: dict[str, Any] = dict(asked) | {"actor": actor_or(asked.actor)} | more
        action = kind(**{field.name: given[field.name] for field in fields(kind)})
        return alarm_model(context, await context.operators.operate(id_, action))

    @router.post("/acknowledge", responses=ACTION_PROBLEMS)
    async def acknowledge(alarm: AlarmId, asked: AcknowledgeModel) -> AlarmModel:
        """Acknowledge an occurrence of an alarm; repeating the request changes nothing."""
        return await done(alarm, asked, operation.Acknowledge)

    @router.post("/shelve", responses=ACTION_PROBLEMS)
    async def shelve(alarm: AlarmId, asked: ShelveModel) -> AlarmModel:
        """Hide an alarm for a limited time; an alarm still active afterwards is announced again."""
        if asked.duration_s > context.max_shelf_s:
            detail = f"duration_s must be at most {context.max_shelf_s:g}, got {asked.duration_s:g}"
            raise ProblemError(422, "Wrong parameter", detail, "duration_s")
        until_ns = context.clock.now_ns() + ns_from_s(asked.duration_s)
        return await done(alarm, asked, operation.Shelve, until_ns=until_ns)

    @router.post("/unshelve", responses=ACTION_PROBLEMS)
    async def unshelve(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """End the shelving of an alarm early."""
        return await done(alarm, asked, operation.Unshelve)

    @router.post("/out-of-service", responses=ACTION_PROBLEMS, dependencies=OUTAGE)
    async def take_out_of_service(alarm: AlarmId, asked: ReasonModel) -> AlarmModel:
        """Hide an alarm until it is returned to service, for example for maintenance."""
        return await done(alarm, asked, operation.TakeOutOfService)

    @router.post("/return-to-service", responses=ACTION_PROBLEMS, dependencies=OUTAGE)
    async def return_to_service(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """Return an alarm to service; an active alarm is announced again."""
        return await done(alarm, asked, operation.ReturnToService)

    @router.post("/reset", responses=ACTION_PROBLEMS)
    async def reset_latched_alarm(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """Release the latch of an acknowledged alarm whose condition has cleared."""
        return await done(alarm, asked, operation.Reset)

    @router.post("/comment", responses=ACTION_PROBLEMS | COMMENT_LIMIT)
    async def comment(request: Request, alarm: AlarmId, asked: CommentModel) -> AlarmModel:
        """Add a comment to the events of an alarm; the state of the alarm does not change."""
        allowances.take(request, context.clock.monotonic_s())
        return await done(alarm, asked, operation.Comment)

    return router


async def event_query(
    chosen: ChosenAlarms,
    times: OptionalTimeRange,
    alarm: Annotated[str | None, only("alarm", "U1:ujb_shaft_x:channel_not_ok", 128)] = None,
    before: Annotated[
        int | None, parameter("Return only events older than this id.", 117, ge=1, le=10**15)
    ] = None,
    limit: Annotated[int, at_most(MAX_EVENTS, "events in the answer")] = 100,
) -> AlarmQuery:
    """Return the query for alarm events from the checked query parameters."""
    return replace(
        chosen,
        before=AlarmQuery.before if before is None else before,
        limit=limit,
        alarm=alarm,
        start_ns=max(times[0], 0),
        end_ns=min(max(times[1], 0), AlarmQuery.end_ns),
    )
