"""The audit trail in the database: its table, and the chain that entries are added to."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, astuple
from pathlib import Path
from threading import Lock

from service.store.access.audit_entries import FIRST, AuditEntry, AuditAction, chained
from service.store.access.audit_verification import (
    HEAD_DIFFERED,
    AuditHead,
    HeadError,
    read_head,
    write_head,
)
from service.store.database import Connection, Database
from service.store.port import StoreError

COLUMNS = (
    "number, time_ns, actor, source, peer, action, object, before, after, reason,"
    " previous_hash, hash"
)
INSERT = f"INSERT INTO audit ({COLUMNS}) VALUES (?,?,?,?,?,?,?,?,?,?,?,?)"  # noqa: S608
SELECT_NEWEST = "SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1"
SELECT_HASH = "SELECT hash FROM audit WHERE number = ?"


class AuditChain:
    """The end of one database's chain; whoever writes to the database does so through it.

    Parameters
    ----------
    head
        File that names the newest entry.
    database
        Whose trail it is.
    """

    def __init__(self, head: Path, database: Database) -> None:
        self._head, self._database = head, database
        self._lock = Lock()
        self._is_due = False
        self.head_error: str | None = None

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Open a transaction; durable when left, and then the head is written."""
        with self._lock:
            self._is_due = False
            with self._database.writing() as writer:
                yield writer
            self._settle()

    def add(self, writer: Connection, deeds: Iterable[AuditAction]) -> None:
        """Add deeds within a transaction; the first one in it compares the head with the chain."""
        for deed in deeds:
            newest = newest_of(writer)
            if not self._is_due and self.head_error is None:
                differed = self._differed(writer, newest)
                if differed is not None:
                    newest = _insert(writer, _told(deed, newest, differed), newest)
            self._is_due = True
            _insert(writer, deed, newest)

    def _differed(self, writer: Connection, newest: AuditHead) -> str | None:
        """What the head says that the chain does not; lagging behind it is no difference."""
        try:
            head = read_head(self._head)
        except HeadError as error:
            is_new = not self._head.exists() and not self._database.ever_had(writer, "audit")
            return None if is_new else f"the head {error}"
        found = writer.execute(SELECT_HASH, (head.number,)).fetchone()
        hash_ = found[0] if found else FIRST if head.number == 0 else None
        if hash_ == head.hash:
            return None
        if head.number > newest.number:
            return f"the head names entry {head.number}, the trail ended at {newest.number}"
        return f"entry {head.number} is not the one that the head names"

    def _settle(self) -> None:
        """Write the head after a transaction that has added entries.

        A deed that is on the disk is not undone because of it: until it succeeds the head lags.
        """
        if not self._is_due and self.head_error is None:
            return
        try:
            self.head_error = self._write_head()
        except StoreError as error:
            self.head_error = f"{self._head}: {error}"

    def _write_head(self) -> str | None:
        """Write it while nobody else adds entries, so that it never goes back; why not, if not."""
        with self._database.writing() as writer:
            newest = newest_of(writer)
            try:
                write_head(self._head, newest)
            except OSError as error:
                return f"{self._head}: {error}"
        return None


def newest_of(reader: Connection) -> AuditHead:
    """Number and hash of the newest entry."""
    found = reader.execute(SELECT_NEWEST).fetchone()
    return AuditHead() if found is None else AuditHead(*found)


def begin_head(path: Path) -> None:
    """Write the head of a trail that is about to begin, unless there is one.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    if not path.exists():
        write_head(path, AuditHead())


def _insert(writer: Connection, deed: AuditAction, newest: AuditHead) -> AuditHead:
    entry = chained(deed, newest.number + 1, newest.hash)
    writer.execute(INSERT, astuple(entry))
    return AuditHead(entry.number, entry.hash)


def _told(deed: AuditAction, newest: AuditHead, why: str) -> AuditAction:
    return AuditAction(
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


AUDIT_TABLES = """
    CREATE TABLE audit (
        number INTEGER PRIMARY KEY AUTOINCREMENT,
        time_ns INTEGER NOT NULL,
        actor TEXT NOT NULL,
        source TEXT NOT NULL CHECK (source IN ('api', 'command_line', 'padwatch')),
        peer TEXT,
        action TEXT NOT NULL,
        object TEXT NOT NULL,
        before TEXT,
        after TEXT,
        reason TEXT NOT NULL,
        previous_hash TEXT NOT NULL,
        hash TEXT NOT NULL
    ) STRICT;
    CREATE INDEX audit_of_actor ON audit (actor, number);
    CREATE INDEX audit_of_action ON audit (action, number);
    CREATE INDEX audit_of_object ON audit (object, number);
    CREATE TRIGGER audit_follows BEFORE INSERT ON audit
    WHEN NEW.number IS NOT (SELECT coalesce(max(number), 0) + 1 FROM audit)
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail follow one another'); END;
    CREATE TRIGGER audit_kept_as_told BEFORE UPDATE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept as they were told'); END;
    CREATE TRIGGER audit_kept BEFORE DELETE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept'); END;
"""
"""Statements of the migration that brings it."""
