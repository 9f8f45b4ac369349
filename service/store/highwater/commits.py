"""Commit counter that detects a database replaced by an older copy."""

import hashlib
import os
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import astuple, dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from core.units import s_from_ns
from service.store.database import Connection
from service.store.highwater.mark import Mark, MarkError, MarkFile, NoMarkError, mark_path
from service.store.port import StoreError

MACHINE_ID = Path("/etc/machine-id")
NO_HOST = ""


def host_id(machine_id: Path = MACHINE_ID) -> str:
    """Return an identifier of this machine, a keyed hash of its machine id.

    Empty if the machine has no machine id, as in many containers.
    """
    try:
        text = machine_id.read_bytes().strip()
    except OSError:
        return NO_HOST
    if not text or text == b"uninitialized":
        return NO_HOST
    return hashlib.blake2b(text, key=b"padwatch", digest_size=8).hexdigest()


MAX_BEHIND = 64
"""Maximum number of transactions by which the file may lag behind the database after a crash."""


class Kind(StrEnum):
    """Kind of a difference between the database and its high-water mark file."""

    ROLLED_BACK = "rolled_back"
    REPLACED = "replaced"
    MARK_LOST = "mark_lost"
    MARK_BEHIND = "mark_behind"
    OTHER_HOST = "other_host"


@dataclass(frozen=True)
class MarkFinding:
    """Difference between the high-water marks in the file and in the database.

    `n_missing` is the number of transactions that the database lacks; None if unknown.
    """

    kind: Kind
    n_missing: int | None
    detail: str


def compared(mark: Mark | str, database: Mark, host: str) -> list[MarkFinding]:
    """Return the differences between two marks; empty if the database is the newest copy.

    Parameters
    ----------
    mark
        Mark in the file, or the reason why it cannot be read. The file must be read first.
    database, host
        Mark in the database, and identifier of this machine.
    """
    if isinstance(mark, str):
        words = (
            f"{mark}; it is unknown whether the database, whose last transaction is of"
            f" {_when(database.time_ns)}, is the newest"
        )
        return [MarkFinding(Kind.MARK_LOST, None, words)]
    found = _history(mark, database)
    if NO_HOST not in (host, mark.host) and mark.host != host:
        found.append(MarkFinding(Kind.OTHER_HOST, None, OTHER_HOST))
    return found


OTHER_HOST = (
    "the data folder was last written by another machine: if padwatch still runs there, two"
    " services monitor the same plant"
)


def _history(mark: Mark, database: Mark) -> list[MarkFinding]:
    if mark.store != database.store:
        words = (
            f"the database was replaced: the previous one had {mark.n_commits} transactions up"
            f" to {_when(mark.time_ns)}, this one has {database.n_commits}"
        )
        return [MarkFinding(Kind.REPLACED, None, words)]
    n_missing = mark.n_commits - database.n_commits
    if n_missing > 0:
        words = (
            "the database was rolled back: transactions written after"
            f" {_when(database.time_ns)}, up to {_when(mark.time_ns)}, are missing"
            f" ({n_missing} in total)"
        )
        return [MarkFinding(Kind.ROLLED_BACK, n_missing, words)]
    if n_missing == 0 and mark.nonce != database.nonce:
        words = (
            f"the database is not the last one used here: transaction {database.n_commits} differs"
            f" from that of {_when(mark.time_ns)}"
        )
        return [MarkFinding(Kind.ROLLED_BACK, None, words)]
    if n_missing < -MAX_BEHIND:
        words = (
            f"the high-water mark is older than the database: it counts {mark.n_commits}"
            f" transactions of {database.n_commits}"
        )
        return [MarkFinding(Kind.MARK_BEHIND, 0, words)]
    return []


def _when(time_ns: int) -> str:
    try:
        moment = datetime.fromtimestamp(s_from_ns(time_ns), UTC)
    except (ValueError, OverflowError, OSError):
        return "an unknown time"
    return f"{moment:%Y-%m-%dT%H:%M:%SZ}"


CREATE = """
    CREATE TABLE IF NOT EXISTS high_water (
        id INTEGER PRIMARY KEY CHECK (id = 1),
        store TEXT NOT NULL,
        host TEXT NOT NULL,
        n_commits INTEGER NOT NULL,
        nonce TEXT NOT NULL,
        time_ns INTEGER NOT NULL
    ) STRICT
"""
"""Statement that creates the table of the mark; SQLite only, hence not a migration."""

COLUMNS = "store, host, n_commits, nonce, time_ns"
SELECT = """
    SELECT CAST(store AS BLOB), CAST(host AS BLOB), n_commits, CAST(nonce AS BLOB), time_ns
    FROM high_water WHERE id = 1
"""
"""Query of the mark; text as bytes, since damaged text may not be UTF-8."""
PUT = f"INSERT OR REPLACE INTO high_water (id, {COLUMNS}) VALUES (1, ?, ?, ?, ?, ?)"  # noqa: S608


class CommitMarks:
    """High-water mark of one database; used only by the owner of its write connection.

    Parameters
    ----------
    file
        High-water mark file beside the database.
    now_ns
        Function that returns the wall-clock time, in ns since 1970 UTC.
    host
        Function that returns the identifier of this machine.

    Attributes
    ----------
    found
        Differences found at opening; empty after `adopted`.
    error
        Error of the last attempt to write the file; None if it succeeded.
    """

    def __init__(
        self, file: MarkFile, now_ns: Callable[[], int], host: Callable[[], str] = host_id
    ) -> None:
        self._file, self._now_ns, self._host = file, now_ns, host()
        self._newest: Mark | None = None
        self.found: Sequence[MarkFinding] = ()
        self.error: str | None = None

    def open(self, writer: Connection, in_file: Mark | str | None) -> None:
        """Compare a newly opened database with the mark file, within a transaction.

        `in_file` is the mark in the file, or the reason why it cannot be read, or None if the file
        is missing. A database without a mark receives a mark, and then a missing file is created.
        Raises `OSError` if the file cannot be created.
        """
        writer.execute(CREATE)
        mark = select_mark(writer)
        if mark is None:
            mark = Mark(_random_hex(16), self._host, 0, _random_hex(8), self._now_ns())
            writer.execute(PUT, astuple(mark))
            if in_file is None:
                self._file.replace(mark)
                return
        lost = f"{self._file.path}: the high-water mark file does not exist"
        self.found = compared(lost if in_file is None else in_file, mark, self._host)

    def count(self, writer: Connection) -> None:
        """Increment the commit counter in the current transaction, unless `found` has differences.

        Raises `StoreError` if the database has lost its mark.
        """
        if self.found:
            return  # keep the differences until they are accepted
        last = select_mark(writer)
        if last is None:
            raise StoreError("the database has no high-water mark; restart padwatch")
        self._put(writer, last, last.n_commits + 1)

    def settle(self) -> None:
        """Write the mark of the committed transaction to the file.

        If the write fails, the transaction stays committed and a later write updates the file.
        """
        if self._newest is None or self.found:
            return
        try:
            self._file.advance(self._newest)
        except MarkError as error:
            self.error = str(error)
        except OSError as error:
            self.error = f"{self._file.path}: {error}"
        else:
            self.error = None

    def adopt(self, writer: Connection) -> None:
        """Accept the database as the newest copy, within a transaction.

        Raises `StoreError` if the database has lost its mark.
        """
        last, in_file = select_mark(writer), self.in_file()
        if last is None:
            raise StoreError("the database has no high-water mark; restart padwatch")
        n_before = in_file.n_commits if isinstance(in_file, Mark) else 0
        # above both counts, so that no earlier mark matches again
        self._put(writer, last, max(last.n_commits, n_before) + 1)

    def adopted(self) -> None:
        """Write the accepted mark to the file; if the write fails, `found` is unchanged."""
        if self._newest is None:
            return
        try:
            self._file.replace(self._newest)
        except OSError as error:
            self.error = f"{self._file.path}: {error}"
        else:
            self.found, self.error = (), None

    def _put(self, writer: Connection, last: Mark, n_commits: int) -> None:
        self._newest = Mark(last.store, self._host, n_commits, _random_hex(8), self._now_ns())
        writer.execute(PUT, astuple(self._newest))

    def in_file(self) -> Mark | str | None:
        """Return the mark in the file, or why it is unreadable; None if the file is missing.

        The file must be read before the database, since the mark in the file may be older than the
        mark in the database, but not newer.
        """
        try:
            return self._file.read()
        except NoMarkError:
            return None
        except MarkError as error:
            return str(error)


def select_mark(reader: Connection) -> Mark | None:
    """Return the high-water mark in a database; None if the database has no mark yet."""
    row = reader.execute(SELECT).fetchone()
    if row is None:
        return None
    store, host, n_commits, nonce, time_ns = row
    texts = (bytes(text).decode("utf-8", "replace") for text in (store, host, nonce))
    store, host, nonce = texts
    return Mark(store, host, int(n_commits), nonce, int(time_ns))


def _random_hex(n_bytes: int) -> str:
    return os.urandom(n_bytes).hex()


def adopt_restored(database: Path) -> None:
    """Write the high-water mark of a restored database to the file beside it.

    Raises
    ------
    OSError
        If the file cannot be written; the next start then reports an older database.
    sqlite3.Error
        If the database cannot be read.
    """
    mark = _mark_of(database)
    file = MarkFile(mark_path(database))
    if mark is None:  # an old backup without a mark receives one when it is opened
        file.path.unlink(missing_ok=True)
    else:
        file.replace(mark)


def _mark_of(database: Path) -> Mark | None:
    # immutable: no journal is read or created
    uri = f"{database.absolute().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as reader:
        has_one = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'high_water'"
        return select_mark(reader) if reader.execute(has_one).fetchone() else None
