"""Seals of stored rows, and what differs from them."""

import marshal
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock

MAX_PLACES = 1000
"""Places that are remembered; beyond it they are only counted."""


@dataclass(frozen=True)
class Place:
    """A row that is not what was written, or not there.

    Parameters
    ----------
    key
        What the row is found by, as it can be written down.
    is_missing
        Whether nothing is there at all.
    """

    table: str
    key: str
    is_missing: bool = False


class DamageLog:
    """Places that were found damaged since the start, each once; used from several threads.

    Parameters
    ----------
    most
        How many places are remembered.
    """

    def __init__(self, most: int = MAX_PLACES) -> None:
        self._most = most
        self._lock = Lock()
        self._places: dict[Place, None] = {}
        self._n_more = 0

    @property
    def n_damaged(self) -> int:
        """How many there are; beyond `most` one that is met again may count again."""
        return len(self._places) + self._n_more

    @property
    def places(self) -> Sequence[Place]:
        """Where, in the order in which they were found."""
        with self._lock:
            return list(self._places)

    def note(self, place: Place) -> None:
        """Remember a place."""
        with self._lock:
            if place in self._places:
                return
            if len(self._places) < self._most:
                self._places[place] = None
            else:
                self._n_more += 1


Cell = int | float | bytes | None
"""Of a stored row; texts as their bytes, for what is damaged need not be text."""

FORMAT = 1
"""Of seals; what has seals of another one is sealed anew."""

_VERSION = 2
"""Of Python's own way to write values: kinds, lengths and all bits of numbers, nothing else.

Later ones write what is there twice as a reference, so that equal rows may look different.
"""


def begun(table: str) -> int:
    """What the seals of a table begin with."""
    return zlib.crc32(table.encode())


def seal_of(begun_with: int, cells: tuple[Cell, ...]) -> int:
    """CRC-32 of a row of a table, which is given by what its seals begin with."""
    return zlib.crc32(marshal.dumps(cells, _VERSION), begun_with)


SEAL, IS_WHOLE = "padwatch_seal_", "padwatch_is_whole_"
"""Functions that the connections of padwatch know; each table has its own, for speed."""

WHOLE = "whole_"
"""Views that show only rows that are whole also to a connection that writes."""


@dataclass(frozen=True)
class SealedTable:
    """A table whose rows have seals.

    Parameters
    ----------
    types
        Of its columns, in their order.
    key
        Columns by which a row is found.
    """

    name: str
    types: Mapping[str, str]
    key: Sequence[str]

    @property
    def columns(self) -> Sequence[str]:
        """Names of its columns, in their order."""
        return list(self.types)

    @property
    def seals(self) -> str:
        """Name of the table with its seals."""
        return f"seal_{self.name}"

    @cached_property
    def create(self) -> Sequence[str]:
        """Make the table of seals, and seal what there is already."""
        keys = ", ".join(self.key)
        # of the same types, or no seal would be found without reading all of them
        typed = ", ".join(f"{column} {self.types[column]} NOT NULL" for column in self.key)
        return (
            f"CREATE TABLE {self.seals} ({typed}, seal INTEGER NOT NULL, PRIMARY KEY ({keys}))"
            " STRICT, WITHOUT ROWID",
            f"INSERT INTO {self.seals} SELECT {keys}, {self._seal('')} FROM {self.name}",  # noqa: S608
        )

    @cached_property
    def triggers(self) -> Sequence[str]:
        """Seal what is written from now on, over this connection."""
        keys = ", ".join(self.key)
        put = (
            f"INSERT INTO {self.seals} VALUES ({self._listed('NEW.')}, {self._seal('NEW.')})"  # noqa: S608
            f" ON CONFLICT ({keys}) DO UPDATE SET seal = excluded.seal;"
        )
        forget = f"DELETE FROM {self.seals} WHERE {self.matched('OLD.')};"  # noqa: S608
        bodies = {"INSERT": put, "UPDATE": forget + put, "DELETE": forget}
        return [
            f"CREATE TEMP TRIGGER sealed_{self.name}_{deed.lower()} AFTER {deed} ON"
            f" main.{self.name} BEGIN {body} END"
            for deed, body in bodies.items()
        ]

    def view(self, before: str = "") -> str:
        """Let this connection see only rows that are whole, by the table's name or another one."""
        listed = ", ".join(f"r.{column} AS {column}" for column in self.columns)
        return (
            f"CREATE TEMP VIEW {before}{self.name} AS SELECT {listed}"  # noqa: S608
            f" FROM main.{self.name} AS r WHERE {self.is_whole('r.')}"
        )

    def is_whole(self, of: str) -> str:
        """Whether a row fits its seal, as an expression."""
        seal = f"SELECT s.seal FROM main.{self.seals} AS s WHERE {self.matched(of, 's.')}"  # noqa: S608
        return f"{IS_WHOLE}{self.name}(({seal}), {self._cells(of)})"

    def matched(self, of: str, ours: str = "") -> str:
        """Whether a row has the key of a seal, as an expression."""
        return " AND ".join(f"{ours}{column} = {of}{column}" for column in self.key)

    def _seal(self, of: str) -> str:
        return f"{SEAL}{self.name}({self._cells(of)})"

    def _listed(self, of: str) -> str:
        return ", ".join(of + column for column in self.key)

    def _cells(self, of: str) -> str:
        return ", ".join(
            f"CAST({of}{column} AS BLOB)" if type_ == "TEXT" else of + column
            for column, type_ in self.types.items()
        )
