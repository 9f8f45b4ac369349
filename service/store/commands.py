"""Commands of operators in the database: rows that are answered once."""

from collections.abc import Collection

from core.units import NS_PER_S
from service.store.commands_port import Answer, Command, CommandState, OpenCommand
from service.store.database import Connect, Connection

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

COLUMNS = "id, unit, kind, document, actor, peer, asked_ns, expires_ns"
INSERT = (
    f"INSERT INTO operator_command ({COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"  # noqa: S608
    " ON CONFLICT (id) DO NOTHING"
)
"""Asked again where nobody could tell whether it was written, it is there once."""
FORGET = "DELETE FROM operator_command WHERE asked_ns < ?"
SELECT_OPEN = f"""
    SELECT {COLUMNS}, taken_by FROM operator_command
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
