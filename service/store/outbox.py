"""Outbox of alarm messages, which are queued in the transaction that stores the alarm event."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field

from core.alarms.alarm import Alarm, AlarmEvent
from service.runtime.models import SERVED, TimeNs
from service.store.database import Connection, Tables


class MessageState(StrEnum):
    """Delivery state of a message; all states but `WAITING` are final."""

    WAITING = "waiting"
    DELIVERED = "delivered"
    REFUSED = "refused"
    EXPIRED = "expired"


DeadState = Literal[MessageState.REFUSED, MessageState.EXPIRED]

DEAD: tuple[DeadState, ...] = (MessageState.REFUSED, MessageState.EXPIRED)
"""Final states of undelivered messages."""


@dataclass(frozen=True)
class OutboxMessage:
    """Message about an alarm event to one receiver.

    Parameters
    ----------
    event_id
        Identifier of the alarm event, the same for all receivers and attempts.
    body
        Content of the message as JSON.
    queued_ns
        Host time of queueing, ns since 1970 UTC.
    is_urgent
        Whether the message is sent even in quiet hours; all waiting messages are sent with it.
    is_active
        Whether the receiver regards the alarm as active after the message.
    closes
        Whether it reports the end of the alarm; only receivers notified of the start get it.
    """

    receiver: str
    event_id: str
    body: str
    queued_ns: int
    is_urgent: bool
    is_active: bool
    closes: bool


Address = Callable[[Alarm, AlarmEvent], Iterable[OutboxMessage]]
"""Function that returns the outbox messages about an alarm event."""


def no_recipients(alarm: Alarm, event: AlarmEvent) -> Iterable[OutboxMessage]:  # noqa: ARG001
    """Return no messages; the default for stores without alarm message receivers."""
    return ()


@dataclass(frozen=True)
class StoredMessage:
    """Message in the outbox, with its delivery state.

    Parameters
    ----------
    id
        Number of the message, in the order of queueing.
    receiver
        Name of the receiver.
    event_id
        Identifier of the event, by which the receiver recognises a repeated message.
    body
        Message as JSON.
    n_attempts
        Number of delivery attempts so far.
    answer
        Reply to the last attempt, or its error; empty before the first attempt.
    done_ns
        Time of delivery, refusal or expiry; None while the message waits.
    """

    id: int
    receiver: str
    event_id: str
    body: str
    queued_ns: int
    is_urgent: bool
    state: MessageState
    n_attempts: int
    answer: str
    done_ns: int | None


@dataclass(frozen=True)
class DeadLetter:
    """Alarm message that will never be delivered."""

    __pydantic_config__ = SERVED

    event_id: Annotated[str, Field(examples=["0b9a6f0e-6a55-4a1e-9a53-0c4b8b3c7b1e"])]
    """Identifier of the message for the receiver."""

    outcome: DeadState
    """Reason for giving up: rejected by the receiver ("refused"), or too old ("expired")."""

    reason: Annotated[str, Field(examples=["410 Gone"])]
    """Answer of the receiver to the last attempt, or reason why it was not reached."""

    time_ns: TimeNs
    """Time when the delivery was abandoned."""


@dataclass(frozen=True)
class Backlog:
    """Delivery statistics of one receiver.

    Parameters
    ----------
    waiting_since_ns
        Queueing time of the oldest waiting message; None if no message waits.
    n_dead
        Total number of refused and expired messages.
    last_dead
        Newest refused or expired message; None if no message was refused or expired.
    last_delivered_ns
        Time of the last delivery; None if no message was delivered.
    """

    n_waiting: int
    waiting_since_ns: int | None
    n_dead: int
    last_dead: DeadLetter | None
    last_delivered_ns: int | None


MAX_ANSWER = 500
"""Maximum length of a stored answer, in characters."""

INSERT = """
    INSERT INTO outbox
    (receiver, event_id, alarm, number, body, queued_ns, is_urgent, is_active)
    SELECT :receiver, :event_id, :alarm, :number, :body, :queued_ns, :is_urgent, :is_active
    WHERE :closes = 0 OR (
        SELECT is_active FROM outbox WHERE receiver = :receiver AND alarm = :alarm
        ORDER BY number DESC LIMIT 1
    ) = 1
"""
"""Statement that queues a message; with ``closes`` only if the last message about the same alarm to
the receiver reported an active alarm."""

COLUMNS = "id, receiver, event_id, body, queued_ns, is_urgent, state, n_attempts, answer, done_ns"
SELECT_WAITING = f"""
    SELECT {COLUMNS} FROM outbox WHERE receiver = ? AND state = 'waiting' ORDER BY id LIMIT ?
"""  # noqa: S608
SELECT_URGENT = """
    SELECT EXISTS (SELECT 1 FROM outbox WHERE receiver = ? AND state = 'waiting' AND is_urgent = 1)
"""
SELECT_LAST = f"""
    SELECT {COLUMNS} FROM outbox WHERE receiver = ? AND state = ? ORDER BY id DESC LIMIT 1
"""  # noqa: S608
FINISH = """
    UPDATE outbox SET state = ?, answer = ?, done_ns = ?, n_attempts = n_attempts + 1
    WHERE id = ? AND state = 'waiting'
"""
FAIL = """
    UPDATE outbox SET answer = ?, n_attempts = n_attempts + 1 WHERE id = ? AND state = 'waiting'
"""
EXPIRE = """
    UPDATE outbox SET state = 'expired', answer = ?, done_ns = ?
    WHERE receiver = ? AND state = 'waiting' AND queued_ns < ? AND NOT EXISTS (
        SELECT 1 FROM alarm_event WHERE alarm_event.alarm = outbox.alarm
        AND alarm_event.number = outbox.number AND alarm_event.time_ns >= ?
    )
"""
"""Statement that expires old messages, but not messages about recent events: their stored time of
queueing is wrong if the host clock was not yet set."""

REVIVE = """
    UPDATE outbox SET state = 'waiting', done_ns = NULL, queued_ns = ?
    WHERE receiver = ? AND state IN ('refused', 'expired')
"""
COUNT = """
    SELECT count(*), min(queued_ns) FROM outbox WHERE receiver = ? AND state = ?
"""


def insert_messages(
    writer: Connection, event: AlarmEvent, messages: Iterable[OutboxMessage]
) -> None:
    """Queue the messages about a newly stored alarm event."""
    of = {"alarm": event.identity.id, "number": event.number}
    writer.executemany(INSERT, [{**vars(message), **of} for message in messages])


class Outbox(Tables):
    """Store of the outbox messages; changes are on the disk when a method returns.

    Answers are truncated to `MAX_ANSWER`. Methods raise `StoreError` if the database is unusable.
    """

    def waiting(self, receiver: str, limit: int) -> list[StoredMessage]:
        """Return the oldest waiting messages to a receiver, in the order of queueing."""
        with self._reading() as reader:
            return [_message(row) for row in reader.execute(SELECT_WAITING, (receiver, limit))]

    def urgent(self, receiver: str) -> bool:
        """Return whether any waiting message to a receiver is urgent."""
        with self._reading() as reader:
            return bool(reader.execute(SELECT_URGENT, (receiver,)).fetchone()[0])

    def finish(self, message: int, state: MessageState, answer: str, now_ns: int) -> None:
        """Count an attempt and set the final state of a waiting message, with the reply `answer`.

        A message that is not waiting stays unchanged.
        """
        with self._writing() as writer:
            writer.execute(FINISH, (state.value, answer[:MAX_ANSWER], now_ns, message))

    def fail(self, message: int, answer: str) -> None:
        """Count a failed attempt to deliver a waiting message; `answer` is the reply or error."""
        with self._writing() as writer:
            writer.execute(FAIL, (answer[:MAX_ANSWER], message))

    def expire(self, receiver: str, before_ns: int, answer: str, now_ns: int) -> int:
        """Expire waiting messages that were queued before `before_ns`, about earlier events.

        `answer` is stored as the reason. Returns the number of expired messages.
        """
        given = (answer[:MAX_ANSWER], now_ns, receiver, before_ns, before_ns)
        with self._writing() as writer:
            return writer.execute(EXPIRE, given).rowcount

    def revive(self, receiver: str, now_ns: int) -> int:
        """Queue refused and expired messages again, in the original order; return their number.

        Their age counts from `now_ns`, so that they do not expire at once; attempts stay counted.
        """
        with self._writing() as writer:
            return writer.execute(REVIVE, (now_ns, receiver)).rowcount

    def backlogs(self) -> dict[str, Backlog]:
        """Return the delivery statistics of all receivers with messages, in the order of names."""
        with self._reading() as reader:
            names = reader.execute("SELECT DISTINCT receiver FROM outbox ORDER BY receiver")
            return {name: _backlog(reader, name) for (name,) in names.fetchall()}


def _backlog(reader: Connection, receiver: str) -> Backlog:
    n_waiting, oldest_ns = reader.execute(COUNT, (receiver, MessageState.WAITING.value)).fetchone()
    dead = [reader.execute(COUNT, (receiver, state.value)).fetchone()[0] for state in DEAD]
    ends = [
        DeadLetter(end.event_id, state, end.answer, end.done_ns or 0)
        for state in DEAD
        if (end := _last(reader, receiver, state))
    ]
    delivered = _last(reader, receiver, MessageState.DELIVERED)
    return Backlog(
        n_waiting=int(n_waiting),
        waiting_since_ns=oldest_ns,
        n_dead=sum(dead),
        last_dead=max(ends, key=lambda end: end.time_ns, default=None),
        last_delivered_ns=delivered.done_ns if delivered else None,
    )


def _last(reader: Connection, receiver: str, state: MessageState) -> StoredMessage | None:
    row = reader.execute(SELECT_LAST, (receiver, state.value)).fetchone()
    return _message(row) if row else None


def _message(row: tuple[Any, ...]) -> StoredMessage:
    found = dict(zip(COLUMNS.split(", "), row, strict=True))
    now = {"is_urgent": bool(found["is_urgent"]), "state": MessageState(found["state"])}
    return StoredMessage(**found | now)


OUTBOX_TABLES = """
    CREATE TABLE outbox (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        receiver TEXT NOT NULL,
        event_id TEXT NOT NULL,
        alarm TEXT NOT NULL,
        number INTEGER NOT NULL,
        body TEXT NOT NULL,
        queued_ns INTEGER NOT NULL,
        is_urgent INTEGER NOT NULL CHECK (is_urgent IN (0, 1)),
        is_active INTEGER NOT NULL CHECK (is_active IN (0, 1)),
        state TEXT NOT NULL DEFAULT 'waiting'
            CHECK (state IN ('waiting', 'delivered', 'refused', 'expired')),
        n_attempts INTEGER NOT NULL DEFAULT 0,
        answer TEXT NOT NULL DEFAULT '',
        done_ns INTEGER,
        UNIQUE (receiver, alarm, number),
        FOREIGN KEY (alarm, number) REFERENCES alarm_event (alarm, number)
    ) STRICT;
    CREATE INDEX outbox_of_receiver ON outbox (receiver, state, id);
    CREATE TRIGGER outbox_kept BEFORE DELETE ON outbox WHEN OLD.state = 'waiting'
    BEGIN SELECT RAISE(ABORT, 'waiting messages are kept'); END;
    CREATE TRIGGER outbox_kept_as_queued
    BEFORE UPDATE OF receiver, event_id, alarm, number, body ON outbox
    BEGIN SELECT RAISE(ABORT, 'messages are kept as they were queued'); END;
    """
"""Migration that creates the outbox table, with one message per alarm event and receiver."""
