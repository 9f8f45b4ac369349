"""Alarms: the list, their history, and what people do to them."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Depends, Path, Query, Request, Response

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
from core.units import ns_from_s
from service.api.alarm_models import (
    AlarmEventsModel,
    AlarmListModel,
    AlarmModel,
)
from service.api.alarm_requests import (
    AcknowledgeModel,
    ActorModel,
    CommentModel,
    OutageModel,
    ShelveModel,
)
from service.api.alarm_tables import event_table
from service.api.alarm_views import alarm_events_model, alarm_list_model, alarm_model, grid_of
from service.api.auth.actors import actor_or
from service.api.auth.declared import Reach, needs
from service.api.auth.gate import identity_of
from service.api.bearing_routes import (
    Moment,
    attitude_range,
    eccentricity_range,
    oil_temperature_range,
)
from service.api.context import Context
from service.api.film_conditions import states_named
from service.api.film_routes import States
from service.api.load.allowance import Allowance
from service.api.parameters import ns_from_datetime, require_order
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.rendering import rendered, worked
from service.api.shared import SharedAnswer
from service.api.tables import Format, table_content, table_response
from service.settings.alarm_kinds import AlarmKindName
from service.store.access.identities import Permission
from service.store.port import AlarmQuery
from service.store.value_range import ValueRange

MAX_EVENTS = 1000

N_COMMENTS = 30
S_PER_COMMENT = 10.0
"""Comments of one person or key at once, and the pause for each further one: they are kept for
ever."""

AlarmId = Annotated[
    str,
    Path(
        description="Identifier of an alarm: unit, subject and kind.",
        max_length=128,
        examples=["U1:ujb_shaft_x:channel_not_ok"],
    ),
]

OUTAGE = [needs(Permission.CHANGE_MEASURING)]
"""Nobody is told of an alarm out of service, for as long as that lasts."""

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
    """Routes that show alarms."""
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
        """The alarm list, most urgent first, and what cannot be judged now."""
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
        """Every transition of every alarm, newest first, page by page.

        State, eccentricity, attitude and oil temperature choose occurrences by the condition under
        which they were raised.

        As CSV or Parquet, too: a row for each transition.
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
    """Routes that people act by; each answers with the alarm as it is then, on the disk."""
    router = APIRouter(
        prefix="/api/v1/alarms/{alarm}",
        tags=["alarms"],
        dependencies=[needs(Permission.ACT_ON_ALARMS)],
    )
    allowances: dict[str, Allowance] = {}

    @router.post("/acknowledge", summary="Acknowledge", responses=ACTION_PROBLEMS)
    async def acknowledge(alarm: AlarmId, asked: AcknowledgeModel) -> AlarmModel:
        """Say that an occurrence has been seen; saying so twice changes nothing."""
        return await _done(
            context, alarm, Acknowledge(**{**dict(asked), "actor": actor_or(asked.actor)})
        )

    @router.post("/shelve", summary="Shelve", responses=ACTION_PROBLEMS)
    async def shelve(alarm: AlarmId, asked: ShelveModel) -> AlarmModel:
        """Take an alarm off the list for a while; if it is active then, it is announced anew."""
        if asked.duration_s > context.max_shelf_s:
            detail = f"duration_s {asked.duration_s:g} is above {context.max_shelf_s:g}"
            raise ProblemError(422, "Wrong parameter", detail, "duration_s")
        until_ns = context.clock.now_ns() + ns_from_s(asked.duration_s)
        return await _done(context, alarm, Shelve(actor_or(asked.actor), asked.reason, until_ns))

    @router.post("/unshelve", summary="Unshelve", responses=ACTION_PROBLEMS)
    async def unshelve(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """Bring a shelved alarm back before its time."""
        return await _done(context, alarm, Unshelve(actor_or(asked.actor)))

    @router.post(
        "/out-of-service",
        summary="Take out of service",
        responses=ACTION_PROBLEMS,
        dependencies=OUTAGE,
    )
    async def take_out(alarm: AlarmId, asked: OutageModel) -> AlarmModel:
        """Take an alarm off the list until it is returned to service, as for maintenance."""
        return await _done(context, alarm, TakeOutOfService(actor_or(asked.actor), asked.reason))

    @router.post(
        "/return-to-service",
        summary="Return to service",
        responses=ACTION_PROBLEMS,
        dependencies=OUTAGE,
    )
    async def return_to_service(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """End that; if the alarm is active, it is announced anew."""
        return await _done(context, alarm, ReturnToService(actor_or(asked.actor)))

    @router.post("/reset", summary="Reset a latched alarm", responses=ACTION_PROBLEMS)
    async def reset(alarm: AlarmId, asked: ActorModel) -> AlarmModel:
        """Release the latch of an alarm that was acknowledged and whose condition has gone."""
        return await _done(context, alarm, Reset(actor_or(asked.actor)))

    @router.post("/comment", summary="Comment", responses=COMMENT_PROBLEMS)
    async def comment(request: Request, alarm: AlarmId, asked: CommentModel) -> AlarmModel:
        """Say something about an alarm; it stands in its history, and the alarm as it was."""
        now_s = context.clock.monotonic_s()
        new = Allowance(N_COMMENTS, S_PER_COMMENT, now_s)
        if not allowances.setdefault(identity_of(request).actor, new).take(now_s):
            detail = f"after {N_COMMENTS} comments in a row one is taken every {S_PER_COMMENT:g} s"
            wait = {"Retry-After": f"{S_PER_COMMENT:.0f}"}
            raise ProblemError(429, "Wait", detail, headers=wait)
        return await _done(context, alarm, Comment(actor_or(asked.actor), asked.text))

    return router


def alarm_by_id_router(context: Context) -> APIRouter:
    """The route of one alarm; after those whose names could be taken for an alarm's."""
    router = APIRouter(
        prefix="/api/v1/alarms", tags=["alarms"], dependencies=[needs(Permission.READ)]
    )

    @router.get("/{alarm}", summary="One alarm", responses=problem_responses(404))
    async def one(alarm: AlarmId) -> AlarmModel:
        """An alarm as it is, also when it is normal, with what was compared with its limit."""
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
        str | None, Query(max_length=32, description="Of this unit only.", examples=["U1"])
    ] = None,
    alarm: Annotated[
        str | None,
        Query(
            max_length=128,
            description="Of this alarm only.",
            examples=["U1:ujb_shaft_x:channel_not_ok"],
        ),
    ] = None,
    kind: Annotated[
        AlarmKindName | None,
        Query(description="Of this kind only.", examples=["channel_not_ok"]),
    ] = None,
    start: Annotated[
        Moment | None,
        Query(description="First time, RFC 3339 with offset.", examples=["2026-11-21T08:00:00Z"]),
    ] = None,
    end: Annotated[
        Moment | None,
        Query(description="Time up to which, likewise.", examples=["2026-11-21T09:00:00Z"]),
    ] = None,
    before: Annotated[
        int | None,
        Query(ge=1, le=10**15, description="Only events older than this id.", examples=[117]),
    ] = None,
    limit: Annotated[
        int, Query(ge=1, le=MAX_EVENTS, description="Most events in the answer.")
    ] = 100,
    state: States = None,
) -> AlarmQuery:
    """Check which events are wanted."""
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
    """Do it, and answer when it is on the disk."""
    try:
        alarm = await context.operators.operate(id_, action)
    except LookupError as error:
        raise ProblemError(404, "Unknown alarm", f"there is no alarm {id_!r}") from error
    except ActionRefusedError as error:
        raise ProblemError(409, "Does not fit", f"alarm {id_}: {error}") from error
    return alarm_model(context.alarms, context.films, alarm)
