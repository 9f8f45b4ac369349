"""The audit trail."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from service.store.access.audit_entries import AuditEntry, AuditAction
from service.store.access.audit_verification import (
    AuditHead,
    HeadError,
    Verdict,
    place_of,
    read_head,
    walk,
)
from service.store.audit_chain import COLUMNS, AuditChain, entry_of, newest_of
from service.store.audit_port import AuditQuery
from service.store.database import Connect, Connection, Reading

SELECT = f"""
    SELECT {COLUMNS} FROM audit
    WHERE number < :before
    AND (CAST(:actor AS TEXT) IS NULL OR actor = :actor)
    AND (CAST(:action AS TEXT) IS NULL OR action = :action)
    AND (CAST(:object AS TEXT) IS NULL OR object = :object)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    ORDER BY number DESC LIMIT :limit
"""  # noqa: S608
SELECT_NEXT = f"SELECT {COLUMNS} FROM audit WHERE number > ? ORDER BY number LIMIT ?"  # noqa: S608
AT_ONCE = 1000


class SqlAudit:
    """The audit trail of one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    """

    def __init__(self, writing: Connect, reading: Reading, chain: AuditChain) -> None:
        self._writing, self._reading, self._chain = writing, reading, chain

    @property
    def head_error(self) -> str | None:
        """Why the head could not be written last; None if it could."""
        return self._chain.head_error

    def record(self, deeds: Sequence[AuditAction]) -> None:
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
        with self._reading("replace") as reader:
            return [entry_of(row) for row in reader.execute(SELECT, vars(query))]


class Trail:
    """The audit trail of a database that may be in use, for those who read no more than that.

    Parameters
    ----------
    reading
        Opens a look at the database, in which text tells every byte from every other.
    head
        File that names the newest entry.
    is_shared
        Whether other hosts write to it as well, each with a head of its own.
    """

    def __init__(self, reading: Connect, head: Path, *, is_shared: bool = False) -> None:
        self._reading, self._head, self._is_shared = reading, head, is_shared

    def verify(self) -> Verdict:
        """Walk all of it, without changing anything.

        Raises
        ------
        StoreError
            If there is none, or it cannot be read.
        """
        head = self._read_head()  # first: it may lag, but not lead
        with self._reading() as reader:
            last = newest_of(reader).number
            verdict = walk(
                _all(reader),
                head,
                lambda entry: place_of(entry, last),
                is_shared=self._is_shared,
            )
        if verdict.n_behind and self._read_head() == AuditHead(verdict.n_entries, verdict.hash):
            return replace(verdict, n_behind=0)  # somebody wrote in between
        return verdict

    @contextmanager
    def entries(self) -> Iterator[Iterator[AuditEntry]]:
        """All of its entries, oldest first.

        Raises
        ------
        StoreError
            If there are none, or they cannot be read.
        """
        with self._reading() as reader:
            yield _all(reader)

    def _read_head(self) -> AuditHead | str:
        try:
            return read_head(self._head)
        except HeadError as error:
            return str(error)


def _all(reader: Connection) -> Iterator[AuditEntry]:
    """Every entry, some at a time, so that no trail needs more memory than another."""
    after = -(2**63)
    while rows := reader.execute(SELECT_NEXT, (after, AT_ONCE)).fetchall():
        yield from map(entry_of, rows)
        if rows[-1][0] <= after:  # a damaged index leads in a circle
            return
        after = rows[-1][0]
