"""Alarms in the words of the API."""

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmState, Hold
from core.alarms.kinds import FILM_KINDS
from core.condition.cells import CellGrid, OperatingPoint
from core.limits import AlarmLevel, Judgement
from service.api.alarm_models import (
    AlarmCountModel,
    AlarmEventModel,
    AlarmEventsModel,
    AlarmListModel,
    AlarmModel,
    ConditionName,
    HoldModel,
    RaisedAtModel,
)
from service.api.alarm_names import AlarmLevelName
from service.api.film_conditions import STATE_NAMES, cell_of, condition_model
from service.api.film_models import FilmConditionModel
from service.api.ports import FilmBoard
from service.live.alarm_board import AlarmBoard
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import value_unit
from service.settings.storage import Origin
from service.store.port import StoredEvent


def alarm_list_model(
    engine: AlarmBoard, films: FilmBoard, origin: Origin, now_ns: int
) -> AlarmListModel:
    """The list of alarms as it stands."""
    alarms = engine.alarms
    listed = [alarm for alarm in alarms if alarm.state is not AlarmState.NORMAL]
    unjudged = [a for a in alarms if a.state is AlarmState.NORMAL and not engine.is_judged(a)]
    return AlarmListModel(
        time=rfc3339(now_ns),
        origin=origin.value,
        count=alarm_count_model(engine),
        alarms=[alarm_model(engine, films, alarm) for alarm in sorted(listed, key=_urgency)],
        unjudged=[alarm_model(engine, films, alarm) for alarm in unjudged],
    )


def alarm_count_model(engine: AlarmBoard) -> AlarmCountModel:
    """How many alarms there are."""
    return AlarmCountModel(**vars(engine.count()))


def alarm_model(engine: AlarmBoard, films: FilmBoard, alarm: Alarm) -> AlarmModel:
    """One alarm as it is shown."""
    identity, condition = alarm.identity, alarm.condition
    is_judged = engine.is_judged(alarm)
    unseen = "not_connected" if condition.is_known else str(condition.reason)
    return AlarmModel(
        id=identity.id,
        unit=identity.unit,
        subject=identity.subject,
        kind=identity.kind,
        state=alarm.state.value,
        level=_level(alarm.level),
        is_active=alarm.level is not None,
        is_acknowledged=alarm.is_acknowledged,
        is_latched=alarm.is_latched,
        is_chattering=engine.is_chattering(alarm),
        occurrence=alarm.occurrence,
        raised=None if alarm.raised_ns is None else rfc3339(alarm.raised_ns),
        raised_at=_raised_at(alarm.raised_at, grid_of(films)),
        condition=_condition(condition) if is_judged else "unknown",
        condition_reason=str(condition.reason) if is_judged else unseen,
        value=condition.value,
        limit=condition.limit,
        value_unit=value_unit(identity.kind),
        film=_film(films, identity),
        suppressed_by=alarm.suppressed_by,
        shelf=_hold(alarm.shelf),
        outage=_hold(alarm.outage),
    )


def _film(films: FilmBoard, identity: AlarmIdentity) -> FilmConditionModel | None:
    """Condition of the newest reading of a film, if the alarm is about one."""
    if identity.kind not in FILM_KINDS:
        return None
    news, rules = films.newest(identity.unit, identity.subject), films.rules(identity.unit)
    if news is None or rules is None:
        return None
    return condition_model(news.reading.time_ns, news.reading.condition, rules.grid)


def alarm_events_model(
    events: list[StoredEvent], origin: Origin, grid: CellGrid, *, there_is_more: bool
) -> AlarmEventsModel:
    """A page of the history."""
    return AlarmEventsModel(
        origin=origin.value,
        events=[event_model(stored, grid) for stored in events],
        next_before=events[-1].id if there_is_more else None,
    )


def grid_of(films: FilmBoard) -> CellGrid:
    """Condition cells of all units."""
    return films.settings.baseline.settings().grid


def event_model(stored: StoredEvent, grid: CellGrid) -> AlarmEventModel:
    """One line of the history."""
    event, identity = stored.event, stored.event.identity
    return AlarmEventModel(
        id=stored.id,
        alarm=identity.id,
        unit=identity.unit,
        subject=identity.subject,
        kind=identity.kind,
        number=event.number,
        change=event.change.value,
        level=_level(event.level),
        state_before=event.state_before.value,
        state_after=event.state_after.value,
        time=rfc3339(event.time_ns),
        occurrence=event.occurrence,
        value=event.value,
        limit=event.limit,
        value_unit=value_unit(identity.kind),
        actor=event.actor,
        reason=str(event.reason),
        raised_at=_raised_at(event.raised_at, grid),
    )


def _raised_at(point: OperatingPoint | None, grid: CellGrid) -> RaisedAtModel | None:
    if point is None:
        return None
    return RaisedAtModel(
        operating_state=STATE_NAMES[point.state],
        eccentricity_ratio=point.eccentricity_ratio,
        attitude_deg=point.attitude_deg,
        oil_temperature_c=point.oil_temperature_c,
        cell=cell_of(point, grid),
    )


def _condition(condition: Judgement) -> ConditionName:
    return "within_limits" if condition.level is None else "active"


def _level(level: AlarmLevel | None) -> AlarmLevelName | None:
    return None if level is None else LEVEL_NAMES[level]


def _hold(hold: Hold | None) -> HoldModel | None:
    if hold is None:
        return None
    return HoldModel(
        actor=hold.actor,
        reason=hold.reason,
        since=rfc3339(hold.since_ns),
        until=None if hold.until_ns is None else rfc3339(hold.until_ns),
    )


def _urgency(alarm: Alarm) -> tuple[bool, bool, int, int]:
    """What needs somebody first comes first; what is hidden, last."""
    shown = alarm.shelf is None and alarm.outage is None and alarm.suppressed_by is None
    return (not shown, alarm.is_acknowledged, -(alarm.level or 0), -(alarm.raised_ns or 0))


LEVEL_NAMES: dict[AlarmLevel, AlarmLevelName] = {
    AlarmLevel.ALERT: "alert",
    AlarmLevel.DANGER: "danger",
}
