"""API models of alarms and alarm events."""

from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import Field

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, AlarmState
from core.alarms.kinds import FILM_STIFFNESS
from core.alarms.life_cycle import next_level
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.condition.cells import CellGrid, OperatingPoint
from core.limits import AlarmLevel
from service.api.context import Context
from service.api.values import (
    ApiModel,
    ByName,
    CellModel,
    FilmConditionModel,
    OperatingStateOf,
    Time,
    TimeNs,
    cell_of,
    condition_model,
)
from service.live.alarm_list import AlarmCount
from service.live.current_state import LiveFilms
from service.settings.alarm_kinds import LEVEL_NAMES, AlarmKindName, AlarmLevelName, value_unit
from service.settings.storage import Origin
from service.store.port import AlarmQuery, StoredEvent, ValueRange

AlarmIdText = Annotated[
    str,
    Field(
        description="Identifier of the alarm: unit, subject and kind, separated by colons.",
        examples=["U1:ujb_shaft_x:channel_not_ok"],
    ),
]


class HoldModel(ApiModel):
    """Period in which an alarm is shelved or out of service."""

    actor: str
    reason: str

    since: Time
    """Start of the period."""

    until: Time | None
    """Planned end of the period; null without a planned end."""


class RaisedAtModel(ApiModel):
    """Operating condition under which an occurrence of an alarm was raised."""

    operating_state: OperatingStateOf
    eccentricity_ratio: Annotated[float | None, Field(examples=[0.37])]
    attitude_deg: Annotated[float | None, Field(examples=[47.0])]
    oil_temperature_c: Annotated[float | None, Field(examples=[46.2])]
    cell: CellModel | None


class AlarmFactsModel(ApiModel):
    """Base class of alarms and their events: subject, kind, value and limit."""

    unit: str
    """Identifier of the unit; "plant" for alarms about the service itself."""

    subject: str
    """Channel or bearing of the alarm; "device" or "link" if it concerns the whole unit; if `unit`
    is "plant", a part of the service, or the unit whose samples were lost."""

    kind: AlarmKindName
    """Kind of alarm."""

    value: Annotated[float | None, Field(examples=[163.2])]
    """Value compared with the limit; the last known value while the condition is unknown; null
    without a value."""

    limit: Annotated[float | None, Field(examples=[150.0])]
    """Limit; null for an alarm without a limit."""

    value_unit: Annotated[str | None, Field(examples=["µm 0-pk"])]
    """Unit of value and limit; null for an alarm without a unit."""

    directions: Annotated[Literal["", "x", "y", "xy"], Field(examples=["xy"])]
    """Directions in which the limit is exceeded; empty for an alarm without directions."""

    raised_at: RaisedAtModel | None
    """Operating condition when the alarm was last raised; null if unknown or never raised."""


class AlarmModel(AlarmFactsModel):
    """Alarm with its current state."""

    id: AlarmIdText

    state: AlarmState
    """State of the alarm in the alarm life cycle of ISA-18.2."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Level of the alarm, used as its priority; null if the alarm is not active."""

    is_active: bool
    """Whether the alarm is active; also true for a shelved, suppressed or out-of-service alarm."""

    is_acknowledged: bool
    """Whether the newest occurrence is acknowledged."""

    is_latched: bool
    """Whether the alarm is latched: its condition has cleared, but it is active until a reset."""

    is_chattering: bool
    """Whether the alarm was chattering in the last ten minutes: raised often in a short time."""

    occurrence: int
    """Number of the newest occurrence, to state in an acknowledgement; it increases by one when the
    alarm is raised or rises in level."""

    raised: Time | None
    """Start of the newest occurrence; null if the alarm was never raised."""

    condition: Literal["active", "within_limits", "unknown"]
    """Condition of the alarm by the newest data; "unknown" without good data. An active alarm whose
    condition becomes unknown stays active."""

    condition_reason: str
    """Code of the reason for `condition`; "ok" without a fault."""

    waits_for: Literal["normal", "alert", "danger"] | None
    """State that the alarm takes if the present condition is certain and lasts for its delay; null
    if no change is pending."""

    evidence: str | None
    """For a film with an active level, the evidence on its cause, with its numbers; else null."""

    film: FilmConditionModel | None
    """Operating condition at the newest film reading, for alarms of film stiffness; null for other
    alarms, and before the first reading."""

    suppressed_by: str | None
    """Reason why the alarm is suppressed by design; null if it is not suppressed."""

    shelf: HoldModel | None
    """Current shelving of the alarm; null if the alarm is not shelved."""

    outage: HoldModel | None
    """Current period out of service; null if the alarm is in service."""


class AlarmListModel(ApiModel):
    """List of alarms that are not normal, and of normal alarms whose condition is unknown."""

    origin: Origin
    count: AlarmCount

    alarms: list[AlarmModel]
    """Alarms that are not normal: unacknowledged first, danger before alert, newest first."""

    unjudged: list[AlarmModel]
    """Alarms that are in the normal state and whose condition is unknown."""


class AlarmEventModel(AlarmFactsModel):
    """Event in the history of an alarm, such as a change of state or a comment."""

    id: int
    """Number of the event in the history of all alarms; later events have higher numbers."""

    alarm: AlarmIdText
    number: int
    change: AlarmChange

    level: Annotated[AlarmLevelName, ByName] | None
    """Level after the event; for a return to normal, the level before the return; null if none."""

    state_before: AlarmState
    """State of the alarm before the event."""

    state_after: AlarmState
    """State of the alarm after the event."""

    time: TimeNs
    """Time of the event: sample time if samples caused it, otherwise time of the host clock."""

    occurrence: int

    actor: str
    """Person or key that caused the event; empty for an automatic change."""

    reason: str
    """Reason or comment given by the actor, or reason for an automatic change; may be empty."""


class AlarmEventsModel(ApiModel):
    """One page of the list of alarm events."""

    origin: Origin
    next_before: int | None

    events: list[AlarmEventModel]
    """Alarm events, newest first."""


def alarm_list_model(
    context: Context, query: AlarmQuery, acknowledged: bool | None = None
) -> AlarmListModel:
    """Return the API model of the list of the alarms that match a query.

    `acknowledged` is whether these alarms are acknowledged; None for both.
    """
    found = [
        alarm
        for alarm in context.alarms.shown
        if acknowledged in (None, alarm.is_acknowledged) and _is_chosen(alarm, query)
    ]
    listed = sorted((a for a in found if a.state is not AlarmState.NORMAL), key=_urgency)
    unjudged = (alarm for alarm in found if alarm.state is AlarmState.NORMAL)
    return AlarmListModel.of(
        context,
        count=context.alarms.count(),
        alarms=[alarm_model(context, alarm) for alarm in listed],
        unjudged=[alarm_model(context, alarm) for alarm in unjudged],
    )


def alarm_list_revision(context: Context) -> Callable[[], Hashable]:
    """Return a function whose value changes with every change of the alarm list."""
    alarms, films = context.alarms, context.films

    @lru_cache(maxsize=1)
    def films_of(revision: int, _: int) -> Hashable:
        found = (_film_news(films, alarm.identity) for alarm in alarms.shown)
        return revision, tuple(news.reading.time_ns for news in found if news is not None)

    return lambda: films_of(alarms.revision, films.n_taken)


def alarm_model(context: Context, alarm: Alarm) -> AlarmModel:
    """Return the API model of an alarm with its current state."""
    identity, condition = alarm.identity, alarm.condition
    engine, films = context.alarms, context.films
    is_judged, grid = engine.is_judged(alarm), films.grid
    unseen = "not_connected" if condition.is_known else str(condition.reason)
    judged = "within_limits" if condition.level is None else "active"
    news = _film_news(films, identity)
    reading = news and news.reading
    cause = news and news.findings[news.worst].attribution
    return AlarmModel.of(
        alarm,
        identity,
        condition,
        is_active=alarm.level is not None,
        is_chattering=engine.is_chattering(alarm),
        raised_at=_raised_at(alarm.raised_at, grid),
        condition=judged if is_judged else "unknown",
        condition_reason=condition.reason if is_judged else unseen,
        value_unit=value_unit(identity.kind),
        waits_for=_awaited(alarm, news, films.rules(identity.unit)) if is_judged else None,
        evidence=cause and cause.reason,
        film=reading and condition_model(reading.time_ns, reading.condition, grid),
    )


def _awaited(alarm: Alarm, news: FilmNews | None, rules: FilmRules | None) -> str | None:
    """Return the state that an alarm takes after its running delays; None if it stays as it is."""
    level, timers = alarm.level, [alarm.timers]
    if news is not None and rules is not None:
        timers = [(each.alert, each.danger) for each in news.decisions]
        changes = [
            abs(each.change or 0.0) / rules.limits(each.quantity).danger_change
            for each in news.findings
        ]
        if level is AlarmLevel.ALERT and max(changes) >= 1.0:
            return LEVEL_NAMES[AlarmLevel.DANGER]  # large, but not certain yet
    after = next_level(level, timers)
    if after is level or alarm.is_latched:
        return None
    return "normal" if after is None else LEVEL_NAMES[after]


RANGES = ("eccentricity_ratio", "oil_temperature_c", "attitude_deg")
"""Quantities of the operating condition, by which queries select alarms."""


def _is_chosen(alarm: Alarm, query: AlarmQuery) -> bool:
    """Return whether an alarm has the subject, level and operating condition of a query."""
    identity, at = alarm.identity, alarm.raised_at
    ranges = {name: getattr(query, name) for name in RANGES}
    return (
        query.unit in (None, identity.unit)
        and query.subject in (None, identity.subject)
        and query.kind in (None, identity.kind)
        and query.level in (None, alarm.level)
        and (not query.states or (at is not None and at.state in query.states))
        and all(
            wanted == ValueRange() or (at is not None and wanted.includes(getattr(at, name)))
            for name, wanted in ranges.items()
        )
    )


def _film_news(films: LiveFilms, identity: AlarmIdentity) -> FilmNews | None:
    is_film = identity.kind == FILM_STIFFNESS
    return films.newest(identity.unit, identity.subject) if is_film else None


def event_model(stored: StoredEvent, grid: CellGrid) -> AlarmEventModel:
    """Return the API model of an alarm event."""
    event, identity = stored.event, stored.event.identity
    return AlarmEventModel.of(
        stored,
        event,
        identity,
        alarm=identity.id,
        value_unit=value_unit(identity.kind),
        raised_at=_raised_at(event.raised_at, grid),
    )


def _raised_at(point: OperatingPoint | None, grid: CellGrid) -> RaisedAtModel | None:
    return None if point is None else RaisedAtModel.of(point, cell=cell_of(point, grid))


def _urgency(alarm: Alarm) -> tuple[bool, bool, int, int]:
    """Return the sort key of an alarm: unacknowledged, danger, newest first; hidden alarms last."""
    shown = alarm.shelf is None and alarm.outage is None and alarm.suppressed_by is None
    return (not shown, alarm.is_acknowledged, -(alarm.level or 0), -(alarm.raised_ns or 0))
