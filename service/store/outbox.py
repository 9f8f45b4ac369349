"""The outbox: letters are queued in the transaction that stores what they tell."""

from collections.abc import Iterable
from typing import Any

from core.alarms.alarm import AlarmEvent
from service.store.database import Connect, Connection
from service.store.outbox_port import DEAD, Backlog, Letter, LetterState, StoredLetter

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


def insert_letters(writer: Connection, event: AlarmEvent, letters: Iterable[Letter]) -> None:
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

    def waiting(self, receiver: str, limit: int) -> list[StoredLetter]:
        """Read the first of what waits for a receiver, in order."""
        with self._read() as reader:
            return [_letter(row) for row in reader.execute(SELECT_WAITING, (receiver, limit))]

    def urgent(self, receiver: str) -> bool:
        """Whether anything that waits for a receiver ends quiet hours."""
        with self._read() as reader:
            return bool(reader.execute(SELECT_URGENT, (receiver,)).fetchone()[0])

    def finish(self, letter: int, state: LetterState, answer: str, now_ns: int) -> None:
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
    n_waiting, oldest_ns = reader.execute(COUNT, (receiver, LetterState.WAITING.value)).fetchone()
    dead = [reader.execute(COUNT, (receiver, state.value)).fetchone()[0] for state in DEAD]
    ends = [_last(reader, receiver, state) for state in DEAD]
    delivered = _last(reader, receiver, LetterState.DELIVERED)
    return Backlog(
        receiver=receiver,
        n_waiting=int(n_waiting),
        oldest_ns=oldest_ns,
        n_dead=sum(dead),
        last_dead=max((end for end in ends if end), key=lambda end: end.done_ns or 0, default=None),
        delivered_ns=delivered.done_ns if delivered else None,
    )


def _last(reader: Connection, receiver: str, state: LetterState) -> StoredLetter | None:
    row = reader.execute(SELECT_LAST, (receiver, state.value)).fetchone()
    return _letter(row) if row else None


def _letter(row: tuple[Any, ...]) -> StoredLetter:
    id_, receiver, event_id, body, queued_ns, is_urgent, state, n_attempts, answer, done_ns = row
    return StoredLetter(
        *(id_, receiver, event_id, body, queued_ns, bool(is_urgent), LetterState(state)),
        *(n_attempts, answer, done_ns),
    )
