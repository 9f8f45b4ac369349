"""Interface of SQLite and PostgreSQL to the SQL of the store.

SQL is written once. Rules for statements that run on both databases:

- parameters are ``?`` with a tuple, or ``:name`` with a mapping; booleans are stored as 0 and 1, so
  compare them with numbers (``is_active = 1``);
- a parameter that is compared with NULL names its type: ``CAST(:unit AS TEXT) IS NULL``,
  ``CAST(:low AS DOUBLE PRECISION) IS NULL``;
- ``ON CONFLICT``, never ``INSERT OR REPLACE``; the old value is ``table.column`` in it;
- no ``rowid``, ``typeof``, ``instr``, ``GLOB``, ``min`` or ``max`` of two values, ``LIMIT -1``;
- rows from which other rows are computed are read through the view ``whole_`` and the table's name,
  which omits damaged rows also in a writing transaction;
- a number assigned by the database is read by ``RETURNING`` or by a separate query.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol

Parameters = tuple[Any, ...] | Mapping[str, Any]

Unreadable = Literal["strict", "replace", "surrogateescape"]
"""Treatment of stored text that is not UTF-8, as the error handlers of `bytes.decode`."""


class Rows(Protocol):
    """Result of a statement."""

    @property
    def rowcount(self) -> int:
        """Number of rows written."""
        ...

    def fetchone(self) -> Any:
        """Return the next row; None after the last."""
        ...

    def fetchall(self) -> list[Any]:
        """Return all remaining rows."""
        ...

    def __iter__(self) -> Iterator[Any]: ...


class Connection(Protocol):
    """Connection within a transaction; used by one thread at a time."""

    def execute(self, statement: str, parameters: Parameters = ..., /) -> Rows:
        """Run a statement. All rows may be held in memory, so queries must be bounded."""
        ...

    def executemany(self, statement: str, parameters: Iterable[Parameters], /) -> Rows:
        """Run a statement once for each set of parameters."""
        ...


Connect = Callable[[], AbstractContextManager[Connection]]
"""Open a writing transaction, which is durable once it is left without an error."""


class Reading(Protocol):
    """Open a read-only transaction, which sees one state of a database."""

    def __call__(self, unreadable: Unreadable = "strict", /) -> AbstractContextManager[Connection]:
        """Open it."""
        ...


class Hold(Protocol):
    """Name held exclusively as long as `is_held` is true."""

    @property
    def is_held(self) -> bool:
        """Check whether the name is still held; a lost name stays lost."""
        ...


class Database(Protocol):
    """One database. All its errors are raised as `StoreError`, with advice."""

    @property
    def kind(self) -> str:
        """``sqlite`` or ``postgresql``."""
        ...

    def writing(self) -> AbstractContextManager[Connection]:
        """Open the only writing transaction of all processes.

        Data read within it stays unchanged until it ends. An error within it undoes all of it. A
        `StoreError` at its end may leave open whether it was committed, so writing the same data
        again must have no effect.
        """
        ...

    def reading(self, unreadable: Unreadable = "strict") -> AbstractContextManager[Connection]:
        """Open a read-only transaction, which sees one state of the database."""
        ...

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Return whether a table that numbers its rows ever had one, even if deleted since."""
        ...

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Hold a name exclusively among all processes that use this database.

        The holder checks `Hold.is_held` before every action that only one process may take: if the
        connection to the database is lost, another process may take the name.

        Raises
        ------
        StoreError
            If another process holds it; the message names that process if it is known.
        """
        ...

    def close(self) -> None:
        """Release all connections; closing twice has no effect."""
        ...


class Tables:
    """Tables of one subject in a database.

    Parameters
    ----------
    writing, reading
        Open a writing and a read-only transaction.
    """

    def __init__(self, writing: Connect, reading: Reading) -> None:
        self._writing, self._reading = writing, reading


def insert(table: str, columns: Sequence[str]) -> str:
    """Return the statement that inserts a row."""
    marks = ", ".join("?" * len(columns))
    return f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({marks})"  # noqa: S608


def upsert(table: str, columns: Sequence[str], key: Sequence[str]) -> str:
    """Return the statement that inserts a row, or replaces the row with the same key."""
    changes = ", ".join(f"{name} = excluded.{name}" for name in columns if name not in key)
    return f"{insert(table, columns)} ON CONFLICT ({', '.join(key)}) DO UPDATE SET {changes}"
