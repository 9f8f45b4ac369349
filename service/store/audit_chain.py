"""`AuditChain`: entries are added in the transaction of what they tell of, the head after it."""

import sqlite3
from collections.abc import Iterable
from dataclasses import asdict, astuple
from pathlib import Path

from service.audit.entry import AuditEntry, Deed
from service.audit.hashing import FIRST, chained
from service.audit.head import AuditHead, HeadError, read_head, write_head
from service.audit.walk import HEAD_DIFFERED

COLUMNS = (
    "number, time_ns, actor, source, peer, action, object, before, after, reason,"
    " previous_hash, hash"
)
INSERT = f"INSERT INTO audit ({COLUMNS}) VALUES (?,?,?,?,?,?,?,?,?,?,?,?)"  # noqa: S608
SELECT_NEWEST = "SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1"
SELECT_HASH = "SELECT hash FROM audit WHERE number = ?"
EVER_USED = "SELECT 1 FROM sqlite_sequence WHERE name = 'audit'"
IS_THERE = "SELECT 1 FROM sqlite_master WHERE name = 'audit'"


class AuditChain:
    """The end of one database's chain; used by whoever holds its writer.

    Parameters
    ----------
    head
        File that names the newest entry.
    """

    def __init__(self, head: Path) -> None:
        self._head = head
        self._is_due = False
        self.head_error: str | None = None

    def begin(self) -> None:
        """Note that a transaction has begun."""
        self._is_due = False

    def add(self, writer: sqlite3.Connection, deeds: Iterable[Deed]) -> None:
        """Add deeds within a transaction; the first one in it compares the head with the chain."""
        for deed in deeds:
            newest = newest_of(writer)
            if not self._is_due and self.head_error is None:
                differed = _differed(writer, newest, self._head)
                if differed is not None:
                    newest = _insert(writer, _told(deed, newest, differed), newest)
            self._is_due = True
            _insert(writer, deed, newest)

    def settle(self, writer: sqlite3.Connection) -> None:
        """Write the head after a transaction that has added entries.

        A deed that is on the disk is not undone because of it: until it succeeds the head lags.
        """
        if not self._is_due and self.head_error is None:
            return
        try:
            self._write_head(writer)
        except (OSError, sqlite3.Error) as error:
            self.head_error = f"{self._head}: {error}"
        else:
            self.head_error = None

    def _write_head(self, writer: sqlite3.Connection) -> None:
        """Write it while nobody else adds entries, so that it never goes back."""
        writer.execute("BEGIN IMMEDIATE")
        try:
            write_head(self._head, newest_of(writer))
        finally:
            if writer.in_transaction:
                writer.execute("ROLLBACK")


def newest_of(reader: sqlite3.Connection) -> AuditHead:
    """Number and hash of the newest entry."""
    found = reader.execute(SELECT_NEWEST).fetchone()
    return AuditHead() if found is None else AuditHead(*found)


def has_trail(reader: sqlite3.Connection) -> bool:
    """Whether a database has an audit trail at all."""
    return reader.execute(IS_THERE).fetchone() is not None


def begin_head(path: Path) -> None:
    """Write the head of a trail that is about to begin, unless there is one.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    if not path.exists():
        write_head(path, AuditHead())


def _insert(writer: sqlite3.Connection, deed: Deed, newest: AuditHead) -> AuditHead:
    entry = chained(deed, newest.number + 1, newest.hash)
    writer.execute(INSERT, astuple(entry))
    return AuditHead(entry.number, entry.hash)


def _differed(writer: sqlite3.Connection, newest: AuditHead, path: Path) -> str | None:
    """What the head says that the chain does not; lagging behind it is no difference."""
    try:
        head = read_head(path)
    except HeadError as error:
        is_new = not path.exists() and writer.execute(EVER_USED).fetchone() is None
        return None if is_new else f"the head {error}"
    found = writer.execute(SELECT_HASH, (head.number,)).fetchone()
    hash_ = found[0] if found else FIRST if head.number == 0 else None
    if hash_ == head.hash:
        return None
    if head.number > newest.number:
        return f"the head names entry {head.number}, the trail ended at {newest.number}"
    return f"entry {head.number} is not the one that the head names"


def _told(deed: Deed, newest: AuditHead, why: str) -> Deed:
    return Deed(
        time_ns=deed.time_ns,
        actor="padwatch",
        action=HEAD_DIFFERED,
        object="audit",
        after=asdict(newest),
        reason=why,
    )


def entry_of(row: tuple[object, ...]) -> AuditEntry:
    """A row as an entry, whatever it holds: what is wrong with it shows in its hash."""
    return AuditEntry(*row)  # type: ignore[arg-type]
