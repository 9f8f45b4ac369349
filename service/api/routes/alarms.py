"""The list of alarms, their events, and what operators do to them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import Field

from core.alarms.operation import (
    Acknowledge,
    Action,
    ActionRefusedError,
    Comment,
    Reset,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
)
from core.condition.cells import CellGrid
from core.units import ns_from_s
from service.api.answers import SharedAnswer, rendered, worked
from service.api.auth.declared import Reach, needs
from service.api.auth.gate import actor_or, identity_of
from service.api.context import Context
from service.api.load import Allowance
from service.api.parameters import (
    EndTime,
    FirstTime,
    States,
    attitude_range,
    eccentricity_range,
    ns_from_datetime,
    oil_temperature_range,
    require_order,
)
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.routes.alarm_models import (
    AlarmEventModel,
    AlarmEventsModel,
    AlarmListModel,
    AlarmModel,
    alarm_events_model,
    alarm_list_model,
    alarm_model,
    event_model,
    grid_of,
)
from service.api.tables import Column, ColumnKind, Format, table_content, table_response
from service.api.values import (
    ActorModel,
    NoteText,
    ReasonText,
    states_named,
)
from service.settings.alarm_kinds import AlarmKindName
from service.store.access.identities import Permission
from service.store.port import AlarmQuery, StoredEvent, ValueRange


class AcknowledgeModel(ActorModel):
    """Acknowledgement of an occurrence of an alarm."""

    occurrence: Annotated[int, Field(ge=1, le=10**15, examples=[3])]
    """Occurrence that is acknowledged; a later one is not."""

    comment: NoteText = ""
    """Note, at most 500 printable characters."""


class CommentModel(ActorModel):
    """Comment on an alarm."""

    text: ReasonText
    """Comment, 1 to 500 printable characters."""


class ShelveModel(ActorModel):
    """Shelving of an alarm for a limited time."""

    reason: ReasonText
    """Reason, 1 to 500 printable characters."""

    duration_s: Annotated[float, Field(ge=1.0, le=31_536_000.0, examples=[3600.0])]
    """Duration, s; the plant file sets the maximum."""


class OutageModel(ActorModel):
    """Removal of an alarm from service."""

    reason: ReasonText
    """Reason, 1 to 500 printable characters."""


COLUMN_KINDS: dict[str, ColumnKind] = {
    "id": "count",
    "number": "count",
    "occurrence": "count",
    "value": "number",
    "limit": "number",
}
"""Columns that are not text."""


RAISED_AT: dict[str, tuple[ColumnKind, str | None]] = {
    "operating_state": ("text", None),
    "eccentricity_ratio": ("number", "1"),
    "attitude_deg": ("number", "deg"),
    "oil_temperature_c": ("number", "°C"),
}
"""Columns of the operating condition when an occurrence was raised, with their units."""


def event_table(events: Sequence[StoredEvent], grid: CellGrid) -> list[Column]:
    """Return the fields of the JSON answer as columns; times are in the column ``time_utc``."""
    rows = [event_model(stored, grid) for stored in events]
    times = Column("time_utc", "time", [stored.event.time_ns for stored in events])
    flat = [name for name in AlarmEventModel.model_fields if name not in ("time", "raised_at")]
    points = [row.raised_at for row in rows]
    return [
        times,
        *(_column(name, rows) for name in flat),
        *(
            Column(name, kind, [point and getattr(point, name) for point in points], unit)
            for name, (kind, unit) in RAISED_AT.items()
        ),
    ]


def _column(name: str, rows: Sequence[AlarmEventModel]) -> Column:
    return Column(name, COLUMN_KINDS.get(name, "text"), [getattr(row, name) for row in rows])


MAX_EVENTS = 1000

N_COMMENTS = 30
S_PER_COMMENT = 10.0
"""Comments that one person or key may send at once, and the pause before each further one.

Comments are never deleted."""

AlarmId = Annotated[
    str,
    Path(
        description="Identifier of an alarm: unit, subject and kind.",
        max_length=128,
        examples=["U1:ujb_shaft_x:channel_not_ok"],
    ),
]

OUTAGE = [needs(Permission.CHANGE_MEASURING)]
"""An alarm out of service sends no messages."""

EVENT_PROBLEMS = described_problems({422: "A wrong parameter", 503: "The store cannot be read"})

ACTION_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown alarm",
        409: "Does not fit the alarm as it is now",
        422: "A wrong parameter",
        503: "Not done, or not on the disk yet",
    }
)

COMMENT_PROBLEMS = ACTION_PROBLEMS | described_problems(
    {429: "Too many comments; Retry-After says how long to wait"}
)


def alarm_router(context: Context) -> APIRouter:
    """Return the routes that show alarms."""
    router = APIRouter(
        prefix="/api/v1/alarms", tags=["alarms"], dependencies=[needs(Permission.READ)]
    )

    engine, films, origin, clock = context.alarms, context.films, context.origin, context.clock
    listed = SharedAnswer(
        lambda: alarm_list_model(engine, films, origin, clock.now_ns()),
        lambda: engine.revision,
        clock,
    )

    @router.get("", summary="All alarms that are not normal", response_model=AlarmListModel)
    async def alarms() -> Response:
        """List alarms, most urgent first, and alarms whose condition is unknown."""
        return await listed.answer()

    @router.get(
        "/events",
        summary="History of all alarms",
        response_model=AlarmEventsModel,
        responses={**EVENT_PROBLEMS, **table_content("History of all alarms")},
        dependencies=[needs(Permission.READ, Reach.ASKED)],
    )
    async def events(
        query: Annotated[AlarmQuery, Depends(event_query)], wanted: Format
    ) -> Response:
        """List events of all alarms, newest first, in pages.

        State, eccentricity, attitude and oil temperature select occurrences by the condition in
        which they were raised.

        As CSV or Parquet: one row per event.
        """
        one_more = replace(query, limit=query.limit + 1)
        grid = grid_of(films)
        found = await worked(lambda: context.store.alarm_events(one_more))
        page, is_more = list(found[: query.limit]), len(found) > query.limit
        if wanted == "json":
            return await rendered(
                lambda: alarm_events_model(page, context.origin, grid, there_is_more=is_more)
            )
        columns = await worked(lambda: event_table(page, grid))
        cursor = str(page[-1].id) if is_more else None
        return table_response(wanted, columns, "alarm-events", cursor)

    return router


def operation_router(context: Context) -> APIRouter:
    """Return the routes that change alarms; each answers with the stored alarm."""
    router = APIRouter(
        prefix="/api/v1/alarms/{alarm}",
        tags=["alarms"],
        dependencies=[needs(Permission.ACT_ON_ALARMS)],
    )
    allowances: dict[str, Allowance] = {}

    @router.post("/acknowledge", summary="Acknowledge", responses=ACTION_PROBLEMS)
    async def acknowledge(alarm: AlarmId, asked: AcknowledgeModel) -> AlarmModel:
        """Acknowledge an occurrence; repeating the request changes nothing."""
        return await _done(
            context, alarm, Acknowledge(**{**dict(asked), "actor": actor_or(asked.actor)})
        )

    @router.post("/shelve", summary="Shelve", responses=ACTION_PROBLEMS)
    async def shelve(alarm: AlarmId, asked: ShelveModel) -> AlarmModel:
        """Hide an alarm for a limited time; if it is active afterwards, it is announced again."""
        if asked.duration_s > context.max_shelf_s:
            detail = f"duration_s {asked.duration_s:g} is above {context.max_shelf_s:g}"
            raise ProblemError(422, "Wrong parameter", detail, "duration_s")
        until_ns = context.clock.now_ns() + ns_from_s(asked.duration_s)
        return await _done(context, alarm, Shelve(actor_or(asked.actor), asked.reason, until_ns))

    @router.post("/unshelve", summary="Unshelve", responses=ACTION_PROBLEMS)
    async def unshelve(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """End a shelving early."""
        return await _done(context, alarm, Unshelve(actor_or(asked.actor)))

    @router.post(
        "/out-of-service",
        summary="Take out of service",
        responses=ACTION_PROBLEMS,
        dependencies=OUTAGE,
    )
    async def take_out(alarm: AlarmId, asked: OutageModel) -> AlarmModel:
        """Hide an alarm until it is returned to service, for example for maintenance."""
        return await _done(context, alarm, TakeOutOfService(actor_or(asked.actor), asked.reason))

    @router.post(
        "/return-to-service",
        summary="Return to service",
        responses=ACTION_PROBLEMS,
        dependencies=OUTAGE,
    )
    async def return_to_service(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """End an outage; if the alarm is active, it is announced again."""
        return await _done(context, alarm, ReturnToService(actor_or(asked.actor)))

    @router.post("/reset", summary="Reset a latched alarm", responses=ACTION_PROBLEMS)
    async def reset(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """Release the latch of an acknowledged alarm whose condition has cleared."""
        return await _done(context, alarm, Reset(actor_or(asked.actor)))

    @router.post("/comment", summary="Comment", responses=COMMENT_PROBLEMS)
    async def comment(request: Request, alarm: AlarmId, asked: CommentModel) -> AlarmModel:
        """Add a comment to the events of an alarm; its state does not change."""
        now_s = context.clock.monotonic_s()
        new = Allowance(N_COMMENTS, S_PER_COMMENT, now_s)
        if not allowances.setdefault(identity_of(request).actor, new).take(now_s):
            detail = f"after {N_COMMENTS} comments, one is accepted every {S_PER_COMMENT:g} s"
            wait = {"Retry-After": f"{S_PER_COMMENT:.0f}"}
            raise ProblemError(429, "Wait", detail, headers=wait)
        return await _done(context, alarm, Comment(actor_or(asked.actor), asked.text))

    return router


def alarm_by_id_router(context: Context) -> APIRouter:
    """Return the route of one alarm; include it after routes that its path would match."""
    router = APIRouter(
        prefix="/api/v1/alarms", tags=["alarms"], dependencies=[needs(Permission.READ)]
    )

    @router.get("/{alarm}", summary="One alarm", responses=problem_responses(404))
    async def one(alarm: AlarmId) -> AlarmModel:
        """Show one alarm, also a normal one, with the value compared with its limit."""
        try:
            return alarm_model(context.alarms, context.films, context.alarms.alarm(alarm))
        except LookupError as error:
            raise ProblemError(404, "Unknown alarm", f"there is no alarm {alarm!r}") from error

    return router


async def event_query(
    eccentricity: Annotated[ValueRange, Depends(eccentricity_range)],
    oil_temperature: Annotated[ValueRange, Depends(oil_temperature_range)],
    attitude: Annotated[ValueRange, Depends(attitude_range)],
    unit: Annotated[
        str | None, Query(max_length=32, description="Only this unit.", examples=["U1"])
    ] = None,
    alarm: Annotated[
        str | None,
        Query(
            max_length=128,
            description="Only this alarm.",
            examples=["U1:ujb_shaft_x:channel_not_ok"],
        ),
    ] = None,
    kind: Annotated[
        AlarmKindName | None,
        Query(description="Only this kind.", examples=["channel_not_ok"]),
    ] = None,
    start: FirstTime = None,
    end: EndTime = None,
    before: Annotated[
        int | None,
        Query(ge=1, le=10**15, description="Only events older than this id.", examples=[117]),
    ] = None,
    limit: Annotated[
        int, Query(ge=1, le=MAX_EVENTS, description="Most events in the answer.")
    ] = 100,
    state: States = None,
) -> AlarmQuery:
    """Return the checked query for events."""
    everything = AlarmQuery()
    start_ns = ns_from_datetime(start, "start") if start else everything.start_ns
    end_ns = ns_from_datetime(end, "end") if end else everything.end_ns
    require_order(start_ns, end_ns)
    return AlarmQuery(
        before=everything.before if before is None else before,
        limit=limit,
        alarm=alarm,
        unit=unit,
        kind=kind,
        start_ns=max(start_ns, 0),
        end_ns=min(max(end_ns, 0), everything.end_ns),
        states=states_named(state),
        eccentricity_ratio=eccentricity,
        oil_temperature_c=oil_temperature,
        attitude_deg=attitude,
    )


async def _done(context: Context, id_: str, action: Action) -> AlarmModel:
    """Carry out an operation; answer when it is stored."""
    try:
        alarm = await context.operators.operate(id_, action)
    except LookupError as error:
        raise ProblemError(404, "Unknown alarm", f"there is no alarm {id_!r}") from error
    except ActionRefusedError as error:
        raise ProblemError(409, "Does not fit", f"alarm {id_}: {error}") from error
    return alarm_model(context.alarms, context.films, alarm)
