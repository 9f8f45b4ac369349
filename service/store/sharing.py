"""Rows by which processes share a plant: state of units, commands, positions on the stream."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from core.units import NS_PER_S
from service.store.database import Connect, Connection


@dataclass(frozen=True)
class UnitReport:
    """What a process says of a unit at one moment.

    Parameters
    ----------
    n_beats
        How often the process has reported; a process that lives never repeats one.
    beat_ns
        When, by its host's clock; nothing is concluded from it.
    link, reason
        Whether samples arrive, in a word, and why not.
    signs
        Document: how samples arrive, and how old everything is.
    revision
        Of the state; another one as soon as the state is another.
    state
        Document: results and alarms; None where it is as it was at the report before.
    """

    unit: str
    n_beats: int
    beat_ns: int
    link: str
    reason: str | None
    last_sample_ns: int | None
    signs: str
    revision: int
    state: bytes | None


@dataclass(frozen=True)
class UnitBeat:
    """The newest report on a unit, without its state.

    Parameters
    ----------
    process
        Which process has written it: another one after each start.
    """

    unit: str
    process: str
    n_beats: int
    beat_ns: int
    signs: str
    revision: int


class UnitStates(Protocol):
    """The newest report on each unit."""

    def report(self, process: str, reports: Sequence[UnitReport]) -> None:
        """Write what a process says of its units, in one transaction."""
        ...

    def beats(self) -> Sequence[UnitBeat]:
        """Read the newest report on each unit, without the states."""
        ...

    def states(self, units: Collection[str]) -> Mapping[str, tuple[str, int, bytes]]:
        """Read states of units: by unit, which process's, its revision, and the document."""
        ...


UNIT_STATUS_TABLES = """
    CREATE TABLE unit_status (
        unit TEXT PRIMARY KEY,
        process TEXT NOT NULL,
        n_beats INTEGER NOT NULL,
        beat_ns INTEGER NOT NULL,
        link TEXT NOT NULL,
        reason TEXT,
        last_sample_ns INTEGER,
        signs TEXT NOT NULL,
        revision INTEGER NOT NULL,
        state BLOB NOT NULL
    ) STRICT;
"""

COLUMNS = "process, n_beats, beat_ns, link, reason, last_sample_ns, signs, revision"
BEAT = """
    UPDATE unit_status SET n_beats = ?, beat_ns = ?, link = ?, reason = ?, last_sample_ns = ?,
    signs = ? WHERE unit = ? AND process = ? AND revision = ?
"""
"""Leaves the state alone, which is large."""

WHOLE = f"""
    INSERT INTO unit_status (unit, {COLUMNS}, state) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (unit) DO UPDATE SET process = excluded.process, n_beats = excluded.n_beats,
    beat_ns = excluded.beat_ns, link = excluded.link, reason = excluded.reason,
    last_sample_ns = excluded.last_sample_ns, signs = excluded.signs,
    revision = excluded.revision, state = excluded.state
"""  # noqa: S608
SELECT_BEATS = (
    "SELECT unit, process, n_beats, beat_ns, signs, revision FROM unit_status ORDER BY unit"
)
SELECT_STATE = "SELECT process, revision, state FROM unit_status WHERE unit = ?"


class StoredUnitStates:
    """The newest report on each unit, in the database of a store.

    Parameters
    ----------
    write, read
        A transaction, and a short look; both raise `StoreError`.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def report(self, process: str, reports: Sequence[UnitReport]) -> None:
        """Write what a process says of its units, in one transaction."""
        with self._write() as writer:
            # in one order everywhere, so that two writers never wait for each other
            for report in sorted(reports, key=lambda report: report.unit):
                _write(writer, process, report)

    def beats(self) -> list[UnitBeat]:
        """Read the newest report on each unit, without the states."""
        with self._read() as reader:
            return [UnitBeat(*row) for row in reader.execute(SELECT_BEATS)]

    def states(self, units: Collection[str]) -> dict[str, tuple[str, int, bytes]]:
        """Read states of units."""
        with self._read() as reader:
            found = {unit: reader.execute(SELECT_STATE, (unit,)).fetchone() for unit in units}
        return {
            unit: (str(row[0]), int(row[1]), bytes(row[2]))
            for unit, row in found.items()
            if row is not None
        }


def _write(writer: Connection, process: str, report: UnitReport) -> None:
    beat = (report.n_beats, report.beat_ns, report.link, report.reason, report.last_sample_ns)
    if report.state is None:
        where = (report.signs, report.unit, process, report.revision)
        writer.execute(BEAT, (*beat, *where))
    else:
        content = (report.signs, report.revision, report.state)
        writer.execute(WHOLE, (report.unit, process, *beat, *content))


class CommandState(StrEnum):
    """What has come of a command."""

    WAITING = "waiting"
    TAKEN = "taken"
    DONE = "done"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    WITHDRAWN = "withdrawn"
    INTERRUPTED = "interrupted"


OPEN = (CommandState.WAITING, CommandState.TAKEN)
"""Not answered yet."""


@dataclass(frozen=True)
class Command:
    """Something that somebody asks for; that he may was checked before.

    Parameters
    ----------
    id
        Another one for each.
    unit
        Whose process is to carry it out.
    kind, document
        What is to be done.
    actor, peer
        Who asks, and from where.
    expires_ns
        Nobody begins to carry it out later than this, by his host's clock.
    """

    id: str
    unit: str
    kind: str
    document: str
    actor: str
    peer: str | None
    asked_ns: int
    expires_ns: int


@dataclass(frozen=True)
class OpenCommand:
    """A command that is not answered, and which process has taken it; None if none has."""

    command: Command
    taken_by: str | None


@dataclass(frozen=True)
class Answer:
    """What has come of a command, with words where there is something to say."""

    state: CommandState
    words: str


DONE = Answer(CommandState.DONE, "")


class Commands(Protocol):
    """Commands of operators; each is carried out once or not at all."""

    def ask(self, command: Command) -> None:
        """Write a command down."""
        ...

    def open(self, units: Collection[str]) -> Sequence[OpenCommand]:
        """Read what is not answered of units, in the order in which it was asked."""
        ...

    def take(self, id_: str, process: str) -> bool:
        """Note that a process carries a command out now; False if it is answered already."""
        ...

    def answer(self, id_: str, answer: Answer, now_ns: int) -> None:
        """Answer a command; one that is answered already stays as it is."""
        ...

    def withdraw(self, id_: str, words: str, now_ns: int) -> bool:
        """Ask no more; False if somebody has taken or answered it."""
        ...

    def look(self, id_: str) -> Answer | None:
        """What has come of a command; None if there is no such command."""
        ...


COMMAND_TABLES = """
    CREATE TABLE operator_command (
        id TEXT PRIMARY KEY,
        unit TEXT NOT NULL,
        kind TEXT NOT NULL,
        document TEXT NOT NULL,
        actor TEXT NOT NULL,
        peer TEXT,
        asked_ns INTEGER NOT NULL,
        expires_ns INTEGER NOT NULL,
        state TEXT NOT NULL DEFAULT 'waiting' CHECK (state IN
            ('waiting', 'taken', 'done', 'refused', 'unknown', 'withdrawn', 'interrupted')),
        taken_by TEXT,
        words TEXT NOT NULL DEFAULT '',
        done_ns INTEGER
    ) STRICT;
    CREATE INDEX operator_command_open ON operator_command (state, unit, asked_ns);
"""

KEPT_NS = 7 * 86_400 * NS_PER_S
"""How long answered commands are kept; what they did stands in the audit trail."""

MAX_OPEN = 200
"""Most that are read at once."""

COMMAND_COLUMNS = "id, unit, kind, document, actor, peer, asked_ns, expires_ns"
INSERT = (
    f"INSERT INTO operator_command ({COMMAND_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"  # noqa: S608
    " ON CONFLICT (id) DO NOTHING"
)
"""Asked again where nobody could tell whether it was written, it is there once."""
FORGET = "DELETE FROM operator_command WHERE asked_ns < ?"
SELECT_OPEN = f"""
    SELECT {COMMAND_COLUMNS}, taken_by FROM operator_command
    WHERE state IN ('waiting', 'taken') ORDER BY asked_ns, id LIMIT ?
"""  # noqa: S608
TAKE = """
    UPDATE operator_command SET state = 'taken', taken_by = ?
    WHERE id = ? AND state IN ('waiting', 'taken')
"""
ANSWER = """
    UPDATE operator_command SET state = ?, words = ?, done_ns = ?
    WHERE id = ? AND state IN ('waiting', 'taken')
"""
WITHDRAW = """
    UPDATE operator_command SET state = 'withdrawn', words = ?, done_ns = ?
    WHERE id = ? AND state = 'waiting'
"""
LOOK = "SELECT state, words FROM operator_command WHERE id = ?"
MAX_WORDS = 2000


class StoredCommands:
    """Commands of operators in the database of a store.

    Parameters
    ----------
    write, read
        A transaction, and a short look; both raise `StoreError`.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def ask(self, command: Command) -> None:
        """Write a command down, and forget those of long ago."""
        with self._write() as writer:
            writer.execute(FORGET, (command.asked_ns - KEPT_NS,))
            writer.execute(INSERT, tuple(vars(command).values()))

    def open(self, units: Collection[str]) -> list[OpenCommand]:
        """Read what is not answered of units, in the order in which it was asked."""
        with self._read() as reader:
            rows = reader.execute(SELECT_OPEN, (MAX_OPEN,)).fetchall()
        found = [OpenCommand(Command(*row[:-1]), row[-1]) for row in rows]
        return [each for each in found if each.command.unit in units]

    def take(self, id_: str, process: str) -> bool:
        """Note that a process carries a command out now; False if it is answered already."""
        with self._write() as writer:
            return bool(writer.execute(TAKE, (process, id_)).rowcount == 1)

    def answer(self, id_: str, answer: Answer, now_ns: int) -> None:
        """Answer a command; one that is answered already stays as it is."""
        with self._write() as writer:
            answer_command(writer, id_, answer, now_ns)

    def withdraw(self, id_: str, words: str, now_ns: int) -> bool:
        """Ask no more; False if somebody has taken or answered it."""
        with self._write() as writer:
            return bool(writer.execute(WITHDRAW, (words, now_ns, id_)).rowcount == 1)

    def look(self, id_: str) -> Answer | None:
        """What has come of a command; None if there is no such command."""
        with self._read() as reader:
            row = reader.execute(LOOK, (id_,)).fetchone()
        return None if row is None else Answer(CommandState(row[0]), str(row[1]))


def answer_command(writer: Connection, id_: str, answer: Answer, now_ns: int) -> None:
    """Answer a command in a transaction that somebody else has begun."""
    writer.execute(ANSWER, (answer.state.value, answer.words[:MAX_WORDS], now_ns, id_))


@dataclass(frozen=True)
class StreamPosition:
    """Up to which message of a stream the stored results of a unit reach.

    Parameters
    ----------
    stream
        Which stream; another one where it was made anew, whose messages are counted anew.
    sequence
        Newest message whose results are stored.
    window_sequence
        First message that must be looked at once more to go on from there.
    memory
        Document: what must be known beside these messages.
    """

    unit: str
    stream: str
    sequence: int
    window_sequence: int
    memory: bytes


POSITION_TABLES = """
    CREATE TABLE stream_position (
        unit TEXT PRIMARY KEY,
        stream TEXT NOT NULL,
        sequence INTEGER NOT NULL,
        window_sequence INTEGER NOT NULL,
        memory BLOB NOT NULL
    ) STRICT;
"""

WRITE = """
    INSERT INTO stream_position (unit, stream, sequence, window_sequence, memory)
    VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (unit) DO UPDATE SET stream = excluded.stream, sequence = excluded.sequence,
    window_sequence = excluded.window_sequence, memory = excluded.memory
    WHERE stream_position.stream <> excluded.stream
    OR stream_position.sequence < excluded.sequence
"""
"""A position never goes back: who was overtaken writes what is there already."""

READ = "SELECT unit, stream, sequence, window_sequence, memory FROM stream_position WHERE unit = ?"


def write_positions(writer: Connection, positions: Iterable[StreamPosition]) -> None:
    """Write the newest position of each unit, within the transaction of its results."""
    newest = {position.unit: position for position in positions}
    # in one order everywhere, so that two writers never wait for each other
    for _, position in sorted(newest.items()):
        writer.execute(
            WRITE,
            (
                position.unit,
                position.stream,
                position.sequence,
                position.window_sequence,
                position.memory,
            ),
        )


def select_position(reader: Connection, unit: str) -> StreamPosition | None:
    """Read the position of a unit; None if it never had one."""
    row = reader.execute(READ, (unit,)).fetchone()
    if row is None:
        return None
    unit, stream, sequence, window_sequence, memory = row
    return StreamPosition(unit, stream, int(sequence), int(window_sequence), bytes(memory))
