"""Tables for communication between processes: unit status, operator commands, stream positions."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from enum import StrEnum

from core.units import NS_PER_S
from service.store.database import Connection, Tables, insert, upsert


@dataclass(frozen=True)
class UnitRow:
    """Status report of a process on a unit.

    Parameters
    ----------
    n_beats
        Number of the report, unique within a process.
    beat_ns
        Time of the report by the clock of its host; for information only.
    signs
        JSON document with the arrival of samples and the age of all data.
    revision
        Revision number of `state`.
    state
        Encoded document of results and alarms; None if unchanged since the previous report.
    """

    unit: str
    n_beats: int
    beat_ns: int
    signs: str
    revision: int
    state: bytes | None


@dataclass(frozen=True)
class UnitBeat:
    """Newest status report on a unit, without the state document.

    Parameters
    ----------
    process
        Identifier of the reporting process, which changes with each start.
    n_beats, beat_ns
        Number of the report, and its time by the clock of its host in ns since 1970 UTC.
    signs
        JSON document with the arrival of samples and the age of all data.
    revision
        Revision number of the state document.
    """

    unit: str
    process: str
    n_beats: int
    beat_ns: int
    signs: str
    revision: int


UNIT_STATUS_TABLES = """
    CREATE TABLE unit_status (
        unit TEXT PRIMARY KEY,
        process TEXT NOT NULL,
        n_beats INTEGER NOT NULL,
        beat_ns INTEGER NOT NULL,
        signs TEXT NOT NULL,
        revision INTEGER NOT NULL,
        state BLOB NOT NULL
    ) STRICT;
"""

REPORT_COLUMNS = [field.name for field in fields(UnitRow)]
UPDATE_BEAT = """
    UPDATE unit_status SET n_beats = :n_beats, beat_ns = :beat_ns, signs = :signs
    WHERE unit = :unit AND process = :process AND revision = :revision
"""
"""Statement that updates a report without its state document, which is large."""

UPSERT_REPORT = upsert("unit_status", [*REPORT_COLUMNS, "process"], ("unit",))
SELECT_BEATS = (
    "SELECT unit, process, n_beats, beat_ns, signs, revision FROM unit_status ORDER BY unit"
)
SELECT_STATE = "SELECT process, revision, state FROM unit_status WHERE unit = ?"


class UnitStates(Tables):
    """Store of the newest status report on each unit."""

    def report(self, process: str, reports: Sequence[UnitRow]) -> None:
        """Write the status reports of a process in one transaction.

        A report without a state keeps the stored state; it is ignored if the stored report is of
        another process or another revision.
        """
        with self._writing() as writer:
            # in a fixed order, so that two writers cannot deadlock
            for report in sorted(reports, key=lambda report: report.unit):
                if report.state is None:
                    writer.execute(UPDATE_BEAT, {**vars(report), "process": process})
                else:
                    writer.execute(UPSERT_REPORT, (*astuple(report), process))

    def beats(self) -> list[UnitBeat]:
        """Return the newest status report on each unit, ordered by unit id, without states."""
        with self._reading() as reader:
            return [UnitBeat(*row) for row in reader.execute(SELECT_BEATS)]

    def states(self, units: Collection[str]) -> dict[str, tuple[str, int, bytes]]:
        """Return process, revision and state document by unit, for the units with a report."""
        with self._reading() as reader:
            found = {unit: reader.execute(SELECT_STATE, (unit,)).fetchone() for unit in units}
        return {
            unit: (str(row[0]), int(row[1]), bytes(row[2]))
            for unit, row in found.items()
            if row is not None
        }


class CommandState(StrEnum):
    """State of an operator command; `UNKNOWN` if it refers to an alarm that does not exist."""

    WAITING = "waiting"
    TAKEN = "taken"
    DONE = "done"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    WITHDRAWN = "withdrawn"
    INTERRUPTED = "interrupted"


OPEN = (CommandState.WAITING, CommandState.TAKEN)
"""States of commands without a final answer."""


@dataclass(frozen=True)
class Command:
    """Operator command; the operator's permission has already been checked.

    Parameters
    ----------
    unit
        Unit whose process executes the command.
    document
        Arguments of the command as JSON.
    actor
        Name of the operator.
    peer
        Network address of the request; None if unknown.
    expires_ns
        Latest time at which execution may begin, by the clock of the sending host.
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
    """Command without a final answer; `taken_by` is the executing process, None if waiting."""

    command: Command
    taken_by: str | None


@dataclass(frozen=True)
class Answer:
    """State of a command with an explanation, which may be empty."""

    state: CommandState
    words: str


DONE = Answer(CommandState.DONE, "")

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
"""Retention time of commands; the audit trail records their effects permanently."""

MAX_OPEN = 200
"""Maximum number of commands that `Commands.open` reads."""

COMMAND_COLUMNS = [field.name for field in fields(Command)]
INSERT = insert("operator_command", COMMAND_COLUMNS) + " ON CONFLICT (id) DO NOTHING"
FORGET = "DELETE FROM operator_command WHERE asked_ns < ?"
SELECT_OPEN = f"""
    SELECT {", ".join(COMMAND_COLUMNS)}, taken_by FROM operator_command
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


class Commands(Tables):
    """Queue of operator commands; each command is executed at most once."""

    def ask(self, command: Command) -> None:
        """Add a command once, even if called repeatedly; delete commands older than `KEPT_NS`."""
        with self._writing() as writer:
            writer.execute(FORGET, (command.asked_ns - KEPT_NS,))
            writer.execute(INSERT, astuple(command))

    def open(self, units: Collection[str]) -> list[OpenCommand]:
        """Return the commands of the given units that have no final answer, oldest first.

        Only the oldest `MAX_OPEN` such commands of all units are considered.
        """
        with self._reading() as reader:
            rows = reader.execute(SELECT_OPEN, (MAX_OPEN,)).fetchall()
        found = [OpenCommand(Command(*row[:-1]), row[-1]) for row in rows]
        return [each for each in found if each.command.unit in units]

    def take(self, id_: str, process: str) -> bool:
        """Record the process that executes a command; return False if answered or unknown.

        A process that was recorded before is replaced; check `OpenCommand.taken_by` before.
        """
        with self._writing() as writer:
            return bool(writer.execute(TAKE, (process, id_)).rowcount == 1)

    def answer(self, id_: str, answer: Answer, now_ns: int) -> None:
        """Write the answer to a command, truncated to `MAX_WORDS`; only the first answer counts."""
        with self._writing() as writer:
            answer_command(writer, id_, answer, now_ns)

    def withdraw(self, id_: str, words: str, now_ns: int) -> bool:
        """Withdraw a waiting command with the answer `words`; return False if it is not waiting."""
        with self._writing() as writer:
            return bool(writer.execute(WITHDRAW, (words, now_ns, id_)).rowcount == 1)

    def look(self, id_: str) -> Answer | None:
        """Return the state and explanation of a command; None if the identifier is unknown."""
        with self._reading() as reader:
            row = reader.execute(LOOK, (id_,)).fetchone()
        return None if row is None else Answer(CommandState(row[0]), str(row[1]))


def answer_command(writer: Connection, id_: str, answer: Answer, now_ns: int) -> None:
    """Write the answer to a command in an open transaction; only the first answer counts."""
    writer.execute(ANSWER, (answer.state.value, answer.words[:MAX_WORDS], now_ns, id_))


@dataclass(frozen=True)
class StreamPosition:
    """Position in a message stream up to which the results of a unit are stored.

    Parameters
    ----------
    stream
        Identifier of the stream; a recreated stream has a new identifier and counts from 1 again.
    sequence
        Sequence number of the newest message whose results are stored.
    window_sequence
        Sequence number of the first message that must be read again to resume.
    memory
        Encoded state of the processing that is needed to resume, besides the messages.
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

POSITION_COLUMNS = [field.name for field in fields(StreamPosition)]
WRITE_POSITION = upsert("stream_position", POSITION_COLUMNS, ("unit",)) + (
    " WHERE stream_position.stream <> excluded.stream"
    " OR stream_position.sequence < excluded.sequence"
)
"""Statement that writes a stream position; a position in a stream only increases."""

READ_POSITION = f"SELECT {', '.join(POSITION_COLUMNS)} FROM stream_position WHERE unit = ?"  # noqa: S608


def write_positions(writer: Connection, positions: Iterable[StreamPosition]) -> None:
    """Write stream positions in the transaction of the results; the last of each unit counts.

    A sequence number below the stored number is ignored, unless the stream is another one.
    """
    newest = {position.unit: position for position in positions}
    # in a fixed order, so that two writers cannot deadlock
    for _, position in sorted(newest.items()):
        writer.execute(WRITE_POSITION, astuple(position))


def select_position(reader: Connection, unit: str) -> StreamPosition | None:
    """Return the stream position of a unit; None if its results never came from a stream."""
    row = reader.execute(READ_POSITION, (unit,)).fetchone()
    return None if row is None else StreamPosition(*row)
