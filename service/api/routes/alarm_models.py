"""API models of alarms and alarm events."""

from typing import Annotated, Literal

from pydantic import Field

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmState
from core.alarms.kinds import FILM_KINDS
from core.condition.cells import CellGrid, OperatingPoint
from core.limits import AlarmLevel
from service.api.context import FilmState
from service.api.values import (
    ApiModel,
    ByName,
    CellModel,
    DatedAnswer,
    FilmConditionModel,
    OperatingStateName,
    Time,
    cell_of,
    condition_model,
)
from service.live.alarm_list import AlarmList
from service.settings.alarm_kinds import AlarmKindName, value_unit
from service.settings.storage import Origin
from service.store.port import StoredEvent

AlarmLevelName = Literal["alert", "danger"]

AlarmStateName = Literal[
    "normal",
    "unacknowledged",
    "acknowledged",
    "returned_unacknowledged",
    "shelved",
    "suppressed",
    "out_of_service",
]

AlarmChangeName = Literal[
    "raised",
    "escalated",
    "eased",
    "returned",
    "latched",
    "reset",
    "acknowledged",
    "shelved",
    "unshelved",
    "suppressed",
    "unsuppressed",
    "taken_out_of_service",
    "returned_to_service",
    "commented",
    "condition_unknown",
    "condition_known",
]


ConditionName = Literal["active", "within_limits", "unknown"]

OriginName = Literal["live", "replay"]

AlarmIdText = Annotated[str, Field(examples=["U1:ujb_shaft_x:channel_not_ok"])]


class HoldModel(ApiModel):
    """Shelving or outage of an alarm."""

    actor: str
    """Person who shelved the alarm or took it out of service."""

    reason: str
    """Reason given by the person."""

    since: Time
    """Start of the shelving or outage."""

    until: Time | None
    """End of the shelving or outage; null without a planned end."""


class RaisedAtModel(ApiModel):
    """Operating condition under which an occurrence of an alarm was raised."""

    operating_state: Annotated[OperatingStateName, ByName]
    """Operating state of the unit."""

    eccentricity_ratio: Annotated[float | None, Field(examples=[0.37])]
    """Eccentricity ratio; null if unknown, and for alarms that concern no bearing."""

    attitude_deg: Annotated[float | None, Field(examples=[47.0])]
    """Attitude angle, degrees; null if unknown."""

    oil_temperature_c: Annotated[float | None, Field(examples=[46.2])]
    """Oil temperature, °C; null if unknown."""

    cell: CellModel | None
    """Condition cell of these values; null if one of the values is unknown."""


class AlarmModel(ApiModel):
    """Alarm with its current state."""

    id: AlarmIdText
    """Stable identifier: unit, subject and kind."""

    unit: str
    """Unit; "plant" for alarms about the service itself."""

    subject: str
    """Channel or bearing; "device" or "link" for the whole unit; for "plant", a part of the service
    or the unit whose samples were lost."""

    kind: AlarmKindName
    """Kind of alarm."""

    state: AlarmStateName
    """State in the life cycle of ISA-18.2."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Level of the alarm, which is its priority; null if the alarm is not active."""

    is_active: bool
    """Whether the alarm is active, also while it is hidden."""

    is_acknowledged: bool
    """Whether the newest occurrence is acknowledged."""

    is_latched: bool
    """Whether only the latch keeps the alarm active: the condition has cleared, a reset is due."""

    is_chattering: bool
    """Whether the alarm was raised too often in a short time, within the last ten minutes."""

    occurrence: int
    """Number of times the alarm was raised or rose in level; acknowledgements refer to it."""

    raised: Time | None
    """Start of the newest occurrence."""

    raised_at: RaisedAtModel | None
    """Operating condition when the alarm was last raised; null if unknown or never raised."""

    condition: ConditionName
    """Current condition; "unknown" without good data. An unknown condition is never a return to
    normal: an active alarm stays active."""

    condition_reason: str
    """Reason of the condition; "ok" without a fault."""

    value: Annotated[float | None, Field(examples=[163.2])]
    """Value compared with the limit; while the condition is unknown, the last known value."""

    limit: Annotated[float | None, Field(examples=[150.0])]
    """Limit; null for an alarm without a limit."""

    value_unit: Annotated[str | None, Field(examples=["µm 0-pk"])]
    """Unit of value and limit."""

    film: FilmConditionModel | None
    """Condition of the newest film reading, for alarms of film stiffness: operating state and cell;
    null for other alarms, and before the first reading."""

    suppressed_by: str | None
    """Reason why the alarm is suppressed by design; null if it is not suppressed."""

    shelf: HoldModel | None
    """Shelving; null if the alarm is not shelved."""

    outage: HoldModel | None
    """Outage; null if the alarm is in service."""


class AlarmCountModel(ApiModel):
    """Counts of alarms by state."""

    n_active: int
    """Number of alarms that are active and not hidden."""

    n_danger: int
    """Number of active alarms at level danger."""

    n_unacknowledged: int
    """Number of alarms that are not hidden and whose newest occurrence is unacknowledged."""

    n_hidden: int
    """Number of alarms that are shelved, suppressed or out of service."""

    n_unjudged: int
    """Number of alarms that are not active and whose condition is unknown."""


class AlarmListModel(DatedAnswer):
    """Alarms that are not normal, and alarms whose condition is unknown."""

    origin: OriginName
    """Origin of the data: live, or replay of a recording."""

    count: AlarmCountModel
    """Counts of alarms by state."""

    alarms: list[AlarmModel]
    """Alarms that are not normal: unacknowledged first, danger before alert, newest first."""

    unjudged: list[AlarmModel]
    """Alarms that were normal when last judged, and whose condition is unknown now."""


class AlarmEventModel(ApiModel):
    """Event of an alarm."""

    id: int
    """Number of the event in the store; later events have higher numbers."""

    alarm: AlarmIdText
    """Identifier of the alarm."""

    unit: str
    """Identifier of the unit."""

    subject: str
    """Subject of the alarm, such as a channel or bearing."""

    kind: AlarmKindName
    """Kind of alarm."""

    number: int
    """Number of the event in the history of the alarm, from 1 without gaps."""

    change: AlarmChangeName
    """Kind of change of the alarm by the event."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Level after the event; for a return to normal, the level before it."""

    state_before: AlarmStateName
    """State of the alarm before the event."""

    state_after: AlarmStateName
    """State of the alarm after the event."""

    time: Time
    """Time of the event: by the samples if they caused it, otherwise by the host clock."""

    occurrence: int
    """Occurrence that the event belongs to."""

    value: float | None
    """Value compared with the limit."""

    limit: float | None
    """Limit; null for an alarm without a limit."""

    value_unit: str | None
    """Unit of value and limit."""

    actor: str
    """Person who caused the event; empty if the change was automatic."""

    reason: str
    """Reason of the event."""

    raised_at: RaisedAtModel | None
    """Operating condition when the occurrence was raised; null if unknown."""


class AlarmEventsModel(ApiModel):
    """Page of alarm events."""

    origin: OriginName
    """Origin of the data: live, or replay of a recording."""

    events: list[AlarmEventModel]
    """Alarm events, newest first."""

    next_before: int | None
    """Value of ``before`` for the next page; null on the last page."""


def alarm_list_model(
    engine: AlarmList, films: FilmState, origin: Origin, now_ns: int
) -> AlarmListModel:
    """Return the API model of the alarm list."""
    alarms = engine.alarms
    listed = [alarm for alarm in alarms if alarm.state is not AlarmState.NORMAL]
    unjudged = [a for a in alarms if a.state is AlarmState.NORMAL and not engine.is_judged(a)]
    return AlarmListModel.of(
        time=now_ns,
        origin=origin,
        count=engine.count(),
        alarms=[alarm_model(engine, films, alarm) for alarm in sorted(listed, key=_urgency)],
        unjudged=[alarm_model(engine, films, alarm) for alarm in unjudged],
    )


def alarm_model(engine: AlarmList, films: FilmState, alarm: Alarm) -> AlarmModel:
    """Return the API model of an alarm."""
    identity, condition = alarm.identity, alarm.condition
    is_judged = engine.is_judged(alarm)
    unseen = "not_connected" if condition.is_known else str(condition.reason)
    judged = "within_limits" if condition.level is None else "active"
    return AlarmModel.of(
        alarm,
        identity,
        condition,
        is_active=alarm.level is not None,
        is_chattering=engine.is_chattering(alarm),
        raised_at=_raised_at(alarm.raised_at, grid_of(films)),
        condition=judged if is_judged else "unknown",
        condition_reason=condition.reason if is_judged else unseen,
        value_unit=value_unit(identity.kind),
        film=_film(films, identity),
    )


def _film(films: FilmState, identity: AlarmIdentity) -> FilmConditionModel | None:
    """Return the condition of the newest reading of a film; None for other alarms."""
    if identity.kind not in FILM_KINDS:
        return None
    news, rules = films.newest(identity.unit, identity.subject), films.rules(identity.unit)
    if news is None or rules is None:
        return None
    return condition_model(news.reading.time_ns, news.reading.condition, rules.grid)


def grid_of(films: FilmState) -> CellGrid:
    """Return the grid of condition cells, which all units share."""
    return films.settings.baseline.settings().grid


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
    if point is None:
        return None
    return RaisedAtModel.of(point, operating_state=point.state, cell=cell_of(point, grid))


def _urgency(alarm: Alarm) -> tuple[bool, bool, int, int]:
    """Return the sort key: hidden alarms last; unacknowledged, danger and newest alarms first."""
    shown = alarm.shelf is None and alarm.outage is None and alarm.suppressed_by is None
    return (not shown, alarm.is_acknowledged, -(alarm.level or 0), -(alarm.raised_ns or 0))


LEVEL_NAMES: dict[AlarmLevel, AlarmLevelName] = {
    AlarmLevel.ALERT: "alert",
    AlarmLevel.DANGER: "danger",
}
