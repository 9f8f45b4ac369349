"""The audit trail in SQLite."""

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path

from service.audit.entry import AuditEntry, Deed
from service.audit.head import AuditHead, HeadError, head_path, read_head
from service.audit.walk import Verdict, place_of, walk
from service.store.audit_chain import COLUMNS, AuditChain, entry_of, newest_of
from service.store.audit_port import AuditQuery
from service.store.port import StoreError

Connect = Callable[[], AbstractContextManager[sqlite3.Connection]]

SELECT = f"""
    SELECT {COLUMNS} FROM audit
    WHERE number < :before
    AND (:actor IS NULL OR actor = :actor)
    AND (:action IS NULL OR action = :action)
    AND (:object IS NULL OR object = :object)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    ORDER BY number DESC LIMIT :limit
"""  # noqa: S608
SELECT_ALL = f"SELECT {COLUMNS} FROM audit ORDER BY number"  # noqa: S608

BUSY_TIMEOUT_S = 5.0


class SqliteAudit:
    """The audit trail of one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    """

    def __init__(self, writing: Connect, reading: Connect, chain: AuditChain) -> None:
        self._writing, self._reading, self._chain = writing, reading, chain

    @property
    def head_error(self) -> str | None:
        """Why the head could not be written last; None if it could."""
        return self._chain.head_error

    def record(self, deeds: Sequence[Deed]) -> None:
        """Write deeds in a transaction of their own.

        Raises
        ------
        StoreError
            If they were not written; the message is the database's.
        """
        with self._writing() as writer:
            self._chain.add(writer, deeds)

    def entries(self, query: AuditQuery) -> list[AuditEntry]:
        """Read entries, newest first."""
        with self._reading() as reader:
            reader.text_factory = _readable
            return [entry_of(row) for row in reader.execute(SELECT, vars(query))]


def verify_trail(database: Path) -> Verdict:
    """Walk the audit trail of a database that may be in use, without changing it.

    Raises
    ------
    StoreError
        If there is none, or it cannot be read.
    """
    head = _head(database)  # first: it may lag, but not lead
    with _opened(database) as reader:
        last = newest_of(reader).number
        return walk(_all(reader), head, lambda entry: place_of(entry, last))


def _head(database: Path) -> AuditHead | str:
    try:
        return read_head(head_path(database))
    except HeadError as error:
        return str(error)


@contextmanager
def trail(database: Path) -> Iterator[Iterator[AuditEntry]]:
    """All entries of a database, oldest first, for those who read no more than that.

    Raises
    ------
    StoreError
        If there is none, or it cannot be read.
    """
    with _opened(database) as reader:
        yield _all(reader)


def _all(reader: sqlite3.Connection) -> Iterator[AuditEntry]:
    return map(entry_of, reader.execute(SELECT_ALL))


@contextmanager
def _opened(database: Path) -> Iterator[sqlite3.Connection]:
    if not database.exists():
        raise StoreError(f"{database.absolute()}: there is no database")
    uri = f"{database.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as reader:
            reader.text_factory = _exact
            yield reader
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{database}: {error}") from error


def _exact(text: bytes) -> str:
    """Text that tells every byte from every other, also where it is not UTF-8."""
    return text.decode("utf-8", "surrogateescape")


def _readable(text: bytes) -> str:
    return text.decode("utf-8", "replace")
