"""Database interface of the store, implemented for SQLite and PostgreSQL.

Each SQL statement is written once and runs on both databases. Rules for statements:

- parameters are ``?`` with a tuple, or ``:name`` with a mapping; booleans are stored as 0 and 1, so
  compare them with numbers (``is_active = 1``);
- a parameter that is compared with NULL names its type: ``CAST(:unit AS TEXT) IS NULL``,
  ``CAST(:low AS DOUBLE PRECISION) IS NULL``;
- ``ON CONFLICT``, never ``INSERT OR REPLACE``; ``table.column`` is the old value in such a clause;
- no ``rowid``, ``typeof``, ``instr``, ``GLOB``, ``min`` or ``max`` of two values, ``LIMIT -1``;
- rows from which other rows are computed are read from the view named ``whole_`` plus the table
  name, which omits damaged rows also in a write transaction;
- a row number assigned by the database is read by ``RETURNING`` or by a separate query.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol

Parameters = tuple[Any, ...] | Mapping[str, Any]

Unreadable = Literal["strict", "replace", "surrogateescape"]
"""Error handler of `bytes.decode` for stored text that is not UTF-8."""


class Rows(Protocol):
    """Result rows of an SQL statement."""

    @property
    def rowcount(self) -> int:
        """Number of rows written."""
        ...

    def fetchone(self) -> Any:
        """Return the next row; None if no row is left."""
        ...

    def fetchall(self) -> list[Any]:
        """Return all remaining rows."""
        ...

    def __iter__(self) -> Iterator[Any]: ...


class Connection(Protocol):
    """Database connection within a transaction; used by one thread at a time."""

    def execute(self, statement: str, parameters: Parameters = ..., /) -> Rows:
        """Run a statement and return its rows; all rows may be kept in memory, so limit them."""
        ...

    def executemany(self, statement: str, parameters: Iterable[Parameters], /) -> Rows:
        """Run a statement once for each set of parameters."""
        ...


Connect = Callable[[], AbstractContextManager[Connection]]
"""Function that opens a transaction; its changes are durable when the block ends without error."""


class Reading(Protocol):
    """Function that opens a read-only transaction on one consistent state of a database."""

    def __call__(self, unreadable: Unreadable = "strict", /) -> AbstractContextManager[Connection]:
        """Open a read-only transaction; `unreadable` is the handling of text that is not UTF-8."""
        ...


class Hold(Protocol):
    """Exclusive lock on a name; valid while `is_held` is true."""

    @property
    def is_held(self) -> bool:
        """Whether the lock is still held; a lost lock is never regained."""
        ...


class Database(Protocol):
    """Database of the store; all its errors are raised as `StoreError` with advice."""

    @property
    def kind(self) -> str:
        """Kind of the database: ``sqlite`` or ``postgresql``."""
        ...

    def writing(self) -> AbstractContextManager[Connection]:
        """Open a write transaction, the only one among all processes, and yield its connection.

        Data that the transaction reads do not change until it ends. An error rolls it back. If
        the commit raises `StoreError`, its outcome may be unknown; therefore writing the same data
        again must have no effect.
        """
        ...

    def reading(self, unreadable: Unreadable = "strict") -> AbstractContextManager[Connection]:
        """Open a read-only transaction on one consistent state, and yield its connection.

        `unreadable` is the error handler of `bytes.decode` for stored text that is not UTF-8.
        """
        ...

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Return whether a table with numbered rows ever had a row, including deleted rows."""
        ...

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Return a lock on a name, exclusive among all processes that use this database.

        The holder checks `Hold.is_held` before every action that only one process may take: if the
        connection to the database is lost, another process may acquire the lock.

        Raises
        ------
        StoreError
            If another process holds the lock; the message names the process if it is known.
        """
        ...

    def close(self) -> None:
        """Close all connections; closing twice has no effect."""
        ...


class Tables:
    """Base class of stores of some of the tables of a database.

    `writing` and `reading` open a transaction. All methods of a store raise `StoreError` if the
    database cannot be used.
    """

    def __init__(self, writing: Connect, reading: Reading) -> None:
        self._writing, self._reading = writing, reading


def insert(table: str, columns: Sequence[str]) -> str:
    """Return the SQL statement that inserts a row, with ``?`` for the value of each column."""
    marks = ", ".join("?" * len(columns))
    return f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({marks})"  # noqa: S608


def upsert(table: str, columns: Sequence[str], key: Sequence[str]) -> str:
    """Return the SQL statement that inserts a row, or updates the row with the same key.

    Each column has a ``?`` for its value; `key` are the columns of the primary key.
    """
    changes = ", ".join(f"{name} = excluded.{name}" for name in columns if name not in key)
    return f"{insert(table, columns)} ON CONFLICT ({', '.join(key)}) DO UPDATE SET {changes}"
