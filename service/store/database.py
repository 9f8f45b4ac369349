"""The database under the store, as its SQL sees it: SQLite and PostgreSQL are behind this.

SQL is written once. What both understand, and what is to be kept to:

- parameters are ``?`` in a tuple, or ``:name`` in a mapping; truths are stored as 0 and 1, so
  compare them (``is_active = 1``);
- a parameter that is compared with NULL names its type: ``CAST(:unit AS TEXT) IS NULL``,
  ``CAST(:low AS DOUBLE PRECISION) IS NULL``;
- ``ON CONFLICT``, never ``INSERT OR REPLACE``; the old value is ``table.column`` in it;
- no ``rowid``, ``typeof``, ``instr``, ``GLOB``, ``min`` or ``max`` of two values, ``LIMIT -1``;
- rows that are computed with and written again are read from ``whole_`` and the table's name: in a
  transaction that writes, too, that shows only what is as it was written;
- a number that the database gave comes back by ``RETURNING`` or by a question of its own.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol

Parameters = tuple[Any, ...] | Mapping[str, Any]

Unreadable = Literal["strict", "replace", "surrogateescape"]
"""What becomes of stored text that is no UTF-8, in the words of `bytes.decode`."""


class Rows(Protocol):
    """What a statement has found."""

    @property
    def rowcount(self) -> int:
        """Rows that it wrote."""
        ...

    def fetchone(self) -> Any:
        """The next row; None after the last."""
        ...

    def fetchall(self) -> list[Any]:
        """All rows that are left."""
        ...

    def __iter__(self) -> Iterator[Any]: ...


class Connection(Protocol):
    """A connection within a transaction; used by one thread at a time."""

    def execute(self, statement: str, parameters: Parameters = ..., /) -> Rows:
        """Run a statement. All that it found may be held in memory: ask for bounded amounts."""
        ...

    def executemany(self, statement: str, parameters: Iterable[Parameters], /) -> Rows:
        """Run a statement once for each set of parameters."""
        ...


Connect = Callable[[], AbstractContextManager[Connection]]
"""Opens a transaction: what was written is durable when it is left without an error."""


class Reading(Protocol):
    """Opens a look at one state of a database."""

    def __call__(self, unreadable: Unreadable = "strict", /) -> AbstractContextManager[Connection]:
        """Open it."""
        ...


class Hold(Protocol):
    """A name that nobody else holds, for as long as `is_held` says so."""

    @property
    def is_held(self) -> bool:
        """Look whether it still is; once lost it stays lost."""
        ...


class Database(Protocol):
    """One database. Its errors come out as `StoreError`, with what to do about them."""

    @property
    def kind(self) -> str:
        """``sqlite`` or ``postgresql``."""
        ...

    def writing(self) -> AbstractContextManager[Connection]:
        """Open a transaction, alone: nobody else writes until it ends, in no other process either.

        Whatever is read in it is therefore so until it ends. An error within undoes all of it.
        One at its end, `StoreError`, may leave open whether it was written: what is written again
        has to count once.
        """
        ...

    def reading(self, unreadable: Unreadable = "strict") -> AbstractContextManager[Connection]:
        """Open a look at one state of the database, whatever is written meanwhile."""
        ...

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Whether a table that numbers its rows ever had one, be it deleted since."""
        ...

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Take a name for oneself, among all processes that use this database.

        The holder asks `Hold.is_held` before each thing that only one may do: where the connection
        to the database is lost, somebody else may take the name.

        Raises
        ------
        StoreError
            If somebody else holds it, who is named as far as that is known.
        """
        ...

    def close(self) -> None:
        """Release everything; closing twice is fine."""
        ...
