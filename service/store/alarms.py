"""Tables of alarms and alarm events; the events of an alarm are numbered without gaps."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from core.alarms.alarm import (
    Alarm,
    AlarmChange,
    AlarmEvent,
    AlarmIdentity,
    AlarmNews,
    AlarmState,
    Hold,
)
from core.condition.cells import OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from service.settings.alarm_kinds import ALARM_KINDS
from service.store.access.audit_entries import ActedNews, AuditAction, Source
from service.store.audit import AuditChain
from service.store.database import Connection, insert, upsert
from service.store.outbox import Address, insert_messages, no_recipients
from service.store.port import AlarmQuery, StoredEvent, StoreError
from service.store.sharing import DONE, answer_command
from service.store.trends import BETWEEN_BOUNDS, IN_STATES, at_least, at_most, condition_arguments

POINT_COLUMNS = ("operating_state", "eccentricity_ratio", "attitude_deg", "oil_temperature_c")
ALARM_COLUMNS = (
    *("id", "unit", "subject", "kind", "level", "occurrence", "is_acknowledged", "raised_ns"),
    *("n_events", "is_known", "condition_level", "value", "limit_value", "reason"),
    *("suppressed_by", "is_latched", "shelf_actor", "shelf_reason", "shelf_since_ns"),
    *("shelf_until_ns", "outage_actor", "outage_reason", "outage_since_ns"),
    *(*POINT_COLUMNS, "directions"),
)
UPSERT = upsert("alarm", ALARM_COLUMNS, ("id",)) + " WHERE alarm.n_events <= excluded.n_events"
"""Statement that writes the state of an alarm; an earlier state does not replace a later one."""

EVENT_COLUMNS = (
    *("alarm", "number", "unit", "subject", "kind", "change", "level", "state_before"),
    *("state_after", "time_ns", "occurrence", "value", "limit_value", "actor", "reason"),
    *(*POINT_COLUMNS, "directions"),
)
INSERT_EVENT = insert("alarm_event", EVENT_COLUMNS) + " ON CONFLICT (alarm, number) DO NOTHING"
SELECT_ALARMS = f"SELECT {', '.join(ALARM_COLUMNS)} FROM alarm ORDER BY id"  # noqa: S608
SELECT_EVENTS = f"""
    SELECT id, {", ".join(EVENT_COLUMNS)} FROM alarm_event
    WHERE id < :before
    AND (CAST(:alarm AS TEXT) IS NULL OR alarm = :alarm)
    AND (CAST(:unit AS TEXT) IS NULL OR unit = :unit)
    AND (CAST(:subject AS TEXT) IS NULL OR subject = :subject)
    AND (CAST(:kind AS TEXT) IS NULL OR kind = :kind)
    AND (CAST(:level AS INTEGER) IS NULL OR level = :level)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    AND {IN_STATES}
    AND {BETWEEN_BOUNDS}
    AND {at_least("attitude_deg", "attitude_low")}
    AND {at_most("attitude_deg", "attitude_high")}
    ORDER BY id DESC LIMIT :limit
"""  # noqa: S608


def insert_alarms(
    writer: Connection,
    news: Iterable[AlarmNews],
    audit: AuditChain,
    address: Address = no_recipients,
) -> None:
    """Insert new alarm events with their messages and audit entries, and update the alarms.

    `address` returns the outbox messages about an event. Stored events are skipped. The operator
    command of an `ActedNews` is answered as done in the same transaction.
    """
    for each in news:
        for event in each.events:
            if writer.execute(INSERT_EVENT, _event_row(event)).rowcount == 1:
                insert_messages(writer, event, address(each.alarm, event))
                audit.add(writer, _actions(event, each))
        writer.execute(UPSERT, _alarm_row(each.alarm))
        if isinstance(each, ActedNews) and each.command is not None:
            # in the same transaction, so that an unanswered command has had no effect
            answer_command(writer, each.command, DONE, each.events[-1].time_ns)


def select_alarms(reader: Connection) -> list[Alarm]:
    """Return the current state of all alarms, ordered by alarm id.

    Raises `StoreError` if a stored alarm is invalid.
    """
    return [_alarm(row) for row in reader.execute(SELECT_ALARMS)]


def select_events(reader: Connection, query: AlarmQuery) -> list[StoredEvent]:
    """Return the alarm events that match a query, newest first."""
    rows = reader.execute(SELECT_EVENTS, _arguments(query))
    return [StoredEvent(int(row[0]), _event(row[1:])) for row in rows]


def _actions(event: AlarmEvent, news: AlarmNews) -> list[AuditAction]:
    """Return the audit entry of an event caused by a person; an empty list for other events."""
    if not event.actor:
        return []
    alarm = news.alarm
    holds = {"shelf": alarm.shelf, "outage": alarm.outage}
    after = {
        "state": event.state_after.value,
        "level": None if event.level is None else event.level.name.lower(),
        "occurrence": event.occurrence,
        **{name: asdict(hold) for name, hold in holds.items() if hold is not None},
    }
    action = AuditAction(
        time_ns=event.time_ns,
        actor=event.actor,
        action=f"alarm.{event.change.value}",
        object=event.identity.id,
        before={"state": event.state_before.value},
        after=after,
        reason=event.reason,
        source=Source.API,  # the only way to act on alarms
        peer=news.peer if isinstance(news, ActedNews) else None,
    )
    return [action]


def _arguments(query: AlarmQuery) -> dict[str, object]:
    names = ("before", "limit", "alarm", "unit", "subject", "kind", "level", "start_ns", "end_ns")
    asked = {name: getattr(query, name) for name in names}
    return (
        asked
        | condition_arguments(query.states, query.eccentricity_ratio, query.oil_temperature_c)
        | {"attitude_low": query.attitude_deg.low, "attitude_high": query.attitude_deg.high}
    )


def _alarm_row(alarm: Alarm) -> tuple[object, ...]:
    identity, condition = alarm.identity, alarm.condition
    shelf, outage = alarm.shelf, alarm.outage
    return (
        *(identity.id, identity.unit, identity.subject, identity.kind),
        *(alarm.level, alarm.occurrence, alarm.is_acknowledged, alarm.raised_ns, alarm.n_events),
        *(condition.is_known, condition.level, condition.value, condition.limit),
        *(str(condition.reason), alarm.suppressed_by, alarm.is_latched),
        *(*_hold_row(shelf), shelf.until_ns if shelf else None),
        *_hold_row(outage),
        *(*_point_row(alarm.raised_at), condition.directions),
    )


def _hold_row(hold: Hold | None) -> tuple[str | None, str | None, int | None]:
    return (None, None, None) if hold is None else (hold.actor, hold.reason, hold.since_ns)


def _event_row(event: AlarmEvent) -> tuple[object, ...]:
    identity = event.identity
    return (
        *(identity.id, event.number, identity.unit, identity.subject, identity.kind),
        *(event.change.value, event.level, event.state_before.value, event.state_after.value),
        *(event.time_ns, event.occurrence, event.value, event.limit, event.actor),
        *(str(event.reason), *_point_row(event.raised_at), event.directions),
    )


def _point_row(point: OperatingPoint | None) -> tuple[float | None, ...]:
    if point is None:
        return (None,) * 4
    numbers = (point.eccentricity_ratio, point.attitude_deg, point.oil_temperature_c)
    return (int(point.state), *numbers)


def _point(found: dict[str, Any]) -> OperatingPoint | None:
    state, *numbers = (found[name] for name in POINT_COLUMNS)
    return None if state is None else OperatingPoint(OperatingState(state), *numbers)


def _alarm(row: tuple[Any, ...]) -> Alarm:
    found = dict(zip(ALARM_COLUMNS, row, strict=True))
    try:
        return Alarm(
            identity=_identity(found),
            level=_level(found["level"]),
            occurrence=found["occurrence"],
            is_acknowledged=bool(found["is_acknowledged"]),
            raised_ns=found["raised_ns"],
            n_events=found["n_events"],
            condition=Judgement(
                level=_level(found["condition_level"]),
                is_known=bool(found["is_known"]),
                value=found["value"],
                limit=found["limit_value"],
                reason=found["reason"],
                suppressed_by=found["suppressed_by"],
                directions=found["directions"],
            ),
            suppressed_by=found["suppressed_by"],
            shelf=_hold(found, "shelf", found["shelf_until_ns"]),
            outage=_hold(found, "outage", None),
            is_latched=bool(found["is_latched"]),
            raised_at=_point(found),
        )
    except ValueError as error:
        raise StoreError(
            f"stored alarm {found['id']} is invalid ({error}); restore a backup"
        ) from error


def _event(row: tuple[Any, ...]) -> AlarmEvent:
    found = dict(zip(EVENT_COLUMNS, row, strict=True))
    try:
        return AlarmEvent(
            identity=_identity(found),
            number=found["number"],
            change=AlarmChange(found["change"]),
            level=_level(found["level"]),
            state_before=AlarmState(found["state_before"]),
            state_after=AlarmState(found["state_after"]),
            time_ns=found["time_ns"],
            occurrence=found["occurrence"],
            value=found["value"],
            limit=found["limit_value"],
            actor=found["actor"],
            reason=found["reason"],
            raised_at=_point(found),
            directions=found["directions"],
        )
    except ValueError as error:
        name = f"stored event {found['number']} of alarm {found['alarm']}"
        raise StoreError(f"{name} is invalid ({error}); restore a backup") from error


def _identity(found: dict[str, Any]) -> AlarmIdentity:
    if found["kind"] not in ALARM_KINDS:
        raise ValueError(f"unknown alarm kind {found['kind']!r}")
    return AlarmIdentity(found["unit"], found["subject"], found["kind"])


def _level(number: int | None) -> AlarmLevel | None:
    return None if number is None else AlarmLevel(number)


def _hold(found: dict[str, Any], name: str, until_ns: int | None) -> Hold | None:
    if found[f"{name}_actor"] is None:
        return None
    reason, since_ns = found[f"{name}_reason"], found[f"{name}_since_ns"]
    return Hold(found[f"{name}_actor"], reason, since_ns, until_ns)
