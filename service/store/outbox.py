"""Letters queued in the transaction of what they report."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol

from core.alarms.alarm import Alarm, AlarmEvent
from service.store.database import Connect, Connection


class MessageState(StrEnum):
    """What has become of a letter; all but the first are for ever."""

    WAITING = "waiting"
    DELIVERED = "delivered"
    REFUSED = "refused"
    EXPIRED = "expired"


DEAD = (MessageState.REFUSED, MessageState.EXPIRED)
"""Letters that will never be delivered."""


@dataclass(frozen=True)
class OutboxMessage:
    """An event of an alarm, to be told to one receiver.

    Parameters
    ----------
    event_id
        The same for all receivers and all attempts.
    body
        The message as JSON.
    queued_ns
        When it was written, by the host's clock.
    is_urgent
        Whether it ends quiet hours.
    is_active
        Whether the receiver takes the alarm for active once it has been told.
    closes
        Whether it is only for a receiver that takes the alarm for active.
    """

    receiver: str
    event_id: str
    body: str
    queued_ns: int
    is_urgent: bool
    is_active: bool
    closes: bool


Address = Callable[[Alarm, AlarmEvent], Iterable[OutboxMessage]]
"""Who is to be told of an event of an alarm."""


def no_recipients(alarm: Alarm, event: AlarmEvent) -> Iterable[OutboxMessage]:  # noqa: ARG001
    """Queue no letters."""
    return ()


@dataclass(frozen=True)
class StoredMessage:
    """A letter in the outbox.

    Parameters
    ----------
    id
        Higher than that of all letters that were queued before it.
    n_attempts
        How often it was tried in vain.
    answer
        What came of the newest attempt, in words.
    done_ns
        When it was delivered or given up; None while it waits.
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
class Backlog:
    """What an outbox holds for one receiver.

    Parameters
    ----------
    oldest_ns
        Since when the first of those that wait does; None if none does.
    n_dead
        How many were refused or given up, ever.
    last_dead
        The newest of these.
    delivered_ns
        When one was delivered last.
    """

    receiver: str
    n_waiting: int
    oldest_ns: int | None
    n_dead: int
    last_dead: StoredMessage | None
    delivered_ns: int | None


class Outbox(Protocol):
    """Durable letters; each method that changes something is on the disk when it returns."""

    def waiting(self, receiver: str, limit: int) -> Sequence[StoredMessage]:
        """Read the first of what waits for a receiver, in order."""
        ...

    def urgent(self, receiver: str) -> bool:
        """Whether anything that waits for a receiver ends quiet hours."""
        ...

    def finish(self, letter: int, state: MessageState, answer: str, now_ns: int) -> None:
        """Note that a letter was delivered or refused."""
        ...

    def fail(self, letter: int, answer: str) -> None:
        """Note an attempt in vain; the letter goes on waiting."""
        ...

    def expire(self, receiver: str, before_ns: int, answer: str, now_ns: int) -> int:
        """Give up what has waited since before a time, and happened before it; return how many."""
        ...

    def revive(self, receiver: str, now_ns: int) -> int:
        """Let what was refused or given up wait again, in its old place; return how many."""
        ...

    def backlogs(self) -> Sequence[Backlog]:
        """Look at everyone for whom there ever was a letter."""
        ...


MAX_ANSWER = 500
"""Characters of what a receiver has said that are kept."""

INSERT = """
    INSERT INTO outbox
    (receiver, event_id, alarm, number, body, queued_ns, is_urgent, is_active)
    SELECT :receiver, :event_id, :alarm, :number, :body, :queued_ns, :is_urgent, :is_active
    WHERE :closes = 0 OR (
        SELECT is_active FROM outbox WHERE receiver = :receiver AND alarm = :alarm
        ORDER BY number DESC LIMIT 1
    ) = 1
"""
"""What was told last says whether a receiver takes an alarm for active."""

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
"""What happened lately is not too old, even if it was queued in 1970 by a clock not yet set."""

REVIVE = """
    UPDATE outbox SET state = 'waiting', done_ns = NULL, queued_ns = ?
    WHERE receiver = ? AND state IN ('refused', 'expired')
"""
COUNT = """
    SELECT count(*), min(queued_ns) FROM outbox WHERE receiver = ? AND state = ?
"""


def insert_messages(writer: Connection, event: AlarmEvent, letters: Iterable[OutboxMessage]) -> None:
    """Queue what tells of an event that has just been stored for the first time."""
    of = {"alarm": event.identity.id, "number": event.number}
    writer.executemany(INSERT, [{**vars(letter), **of} for letter in letters])


class SqlOutbox:
    """The outbox of a database.

    Parameters
    ----------
    write, read
        A transaction of the database's one writer, and a short look at it; both raise `StoreError`.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def waiting(self, receiver: str, limit: int) -> list[StoredMessage]:
        """Read the first of what waits for a receiver, in order."""
        with self._read() as reader:
            return [_letter(row) for row in reader.execute(SELECT_WAITING, (receiver, limit))]

    def urgent(self, receiver: str) -> bool:
        """Whether anything that waits for a receiver ends quiet hours."""
        with self._read() as reader:
            return bool(reader.execute(SELECT_URGENT, (receiver,)).fetchone()[0])

    def finish(self, letter: int, state: MessageState, answer: str, now_ns: int) -> None:
        """Note that a letter was delivered or refused; saying so twice changes nothing."""
        with self._write() as writer:
            writer.execute(FINISH, (state.value, answer[:MAX_ANSWER], now_ns, letter))

    def fail(self, letter: int, answer: str) -> None:
        """Note an attempt in vain; the letter goes on waiting."""
        with self._write() as writer:
            writer.execute(FAIL, (answer[:MAX_ANSWER], letter))

    def expire(self, receiver: str, before_ns: int, answer: str, now_ns: int) -> int:
        """Give up what has waited since before a time; return how many."""
        with self._write() as writer:
            words = answer[:MAX_ANSWER]
            given = (words, now_ns, receiver, before_ns, before_ns)
            return writer.execute(EXPIRE, given).rowcount

    def revive(self, receiver: str, now_ns: int) -> int:
        """Let what was refused or given up wait again, in its old place; return how many."""
        with self._write() as writer:
            return writer.execute(REVIVE, (now_ns, receiver)).rowcount

    def backlogs(self) -> list[Backlog]:
        """Look at everyone for whom there ever was a letter."""
        with self._read() as reader:
            names = reader.execute("SELECT DISTINCT receiver FROM outbox ORDER BY receiver")
            return [_backlog(reader, str(name)) for (name,) in names.fetchall()]


def _backlog(reader: Connection, receiver: str) -> Backlog:
    n_waiting, oldest_ns = reader.execute(COUNT, (receiver, MessageState.WAITING.value)).fetchone()
    dead = [reader.execute(COUNT, (receiver, state.value)).fetchone()[0] for state in DEAD]
    ends = [_last(reader, receiver, state) for state in DEAD]
    delivered = _last(reader, receiver, MessageState.DELIVERED)
    return Backlog(
        receiver=receiver,
        n_waiting=int(n_waiting),
        oldest_ns=oldest_ns,
        n_dead=sum(dead),
        last_dead=max((end for end in ends if end), key=lambda end: end.done_ns or 0, default=None),
        delivered_ns=delivered.done_ns if delivered else None,
    )


def _last(reader: Connection, receiver: str, state: MessageState) -> StoredMessage | None:
    row = reader.execute(SELECT_LAST, (receiver, state.value)).fetchone()
    return _letter(row) if row else None


def _letter(row: tuple[Any, ...]) -> StoredMessage:
    id_, receiver, event_id, body, queued_ns, is_urgent, state, n_attempts, answer, done_ns = row
    return StoredMessage(
        *(id_, receiver, event_id, body, queued_ns, bool(is_urgent), MessageState(state)),
        *(n_attempts, answer, done_ns),
    )


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
    CREATE TRIGGER outbox_kept BEFORE DELETE ON outbox
    BEGIN SELECT RAISE(ABORT, 'what was told is kept'); END;
    CREATE TRIGGER outbox_kept_as_queued
    BEFORE UPDATE OF receiver, event_id, alarm, number, body ON outbox
    BEGIN SELECT RAISE(ABORT, 'what is told is kept as it was queued'); END;
    """
"""A letter for each event and receiver; nothing of it is changed but what has come of it."""
