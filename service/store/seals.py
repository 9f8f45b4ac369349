"""Checksums of stored rows, and the rows that differ from them."""

import marshal
import sqlite3
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any

from service.store.database import Connection

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


OTHERWISE_KEPT = frozenset({"spectrum", "high_water", "rollup_redo"})
"""Tables whose rows have checksums of their own, and those that only say what is to be done."""

SCHEMA = "CREATE TABLE IF NOT EXISTS seal_schema (id INTEGER PRIMARY KEY, number INTEGER)"
SEALED_AT = "SELECT number FROM seal_schema WHERE id = 1"
SET_SEALED_AT = "INSERT OR REPLACE INTO seal_schema VALUES (1, ?)"
"""An upgrade changes tables, perhaps rows: what was sealed before it is sealed anew."""
PER_FORMAT = 1_000_000
"""Of that number: the format of seals counts, too."""

WALK = "CREATE TABLE IF NOT EXISTS seal_walk (id INTEGER PRIMARY KEY, place TEXT)"
"""How far somebody has come who looks at all rows in turn."""

TABLES = """
    SELECT name FROM main.sqlite_master
    WHERE type = 'table' AND name NOT GLOB 'sqlite_*' AND name NOT GLOB 'seal_*' ORDER BY name
"""


class Seals:
    """The seals of one database file.

    Parameters
    ----------
    damage
        Is told of rows that do not fit their seals.
    """

    def __init__(self, damage: DamageLog) -> None:
        self._damage = damage
        self.tables: dict[str, SealedTable] = {}

    def begin(self, writer: sqlite3.Connection) -> None:
        """Seal what is not sealed yet, within a transaction, and all that is written later."""
        self.tables = {table.name: table for table in _tables(writer)}
        self.teach(writer)
        (schema,) = writer.execute("PRAGMA main.user_version").fetchone()
        now = (FORMAT * PER_FORMAT + schema,)
        writer.execute(SCHEMA)
        writer.execute(WALK)
        if writer.execute(SEALED_AT).fetchone() != now:
            self._anew(writer)
            writer.execute(SET_SEALED_AT, now)
        for table in self.tables.values():
            for statement in (*table.triggers, table.view(WHOLE)):
                writer.execute(statement)

    def _anew(self, writer: sqlite3.Connection) -> None:
        for table in self.tables.values():
            writer.execute(f"DROP TABLE IF EXISTS {table.seals}")
            for statement in table.create:
                writer.execute(statement)

    def know(self, reader: sqlite3.Connection) -> None:
        """Find out which tables have seals, of a database that somebody else may be writing to."""
        there = {name for (name,) in reader.execute("SELECT name FROM main.sqlite_master")}
        self.tables = {t.name: t for t in _tables(reader) if t.seals in there}
        self.teach(reader)

    def guard(self, reader: sqlite3.Connection) -> None:
        """Let a connection see only rows that are whole."""
        self.teach(reader)
        for table in self.tables.values():
            reader.execute(table.view())
            reader.execute(table.view(WHOLE))

    def teach(self, connection: sqlite3.Connection) -> None:
        """Let a connection compute seals."""
        for name in self.tables:
            connection.create_function(SEAL + name, -1, _sealed(name), deterministic=True)
            is_whole = self._is_whole(name)
            connection.create_function(IS_WHOLE + name, -1, is_whole, deterministic=True)

    def _is_whole(self, name: str) -> Callable[..., bool]:
        begun_with = begun(name)

        def is_whole(seal: int | None, *cells: Cell) -> bool:
            return seal_of(begun_with, cells) == seal or self._noted(name, cells)

        return is_whole

    def _noted(self, name: str, cells: Sequence[Cell]) -> bool:
        self._damage.note(Place(name, self.key_of(name, cells)))
        return False

    def key_of(self, name: str, cells: Sequence[object]) -> str:
        """What a row is found by, as words."""
        table = self.tables[name]
        cell_of = dict(zip(table.columns, cells, strict=True))
        return ", ".join(f"{column} {_cell_words(cell_of[column])}" for column in table.key)


def _sealed(name: str) -> Callable[..., int]:
    begun_with = begun(name)
    return lambda *cells: seal_of(begun_with, cells)


def _cell_words(cell: object) -> str:
    if isinstance(cell, bytes):
        return repr(cell.decode("utf-8", "replace")[:80])
    return str(cell)


def _tables(reader: sqlite3.Connection) -> list[SealedTable]:
    names = [name for (name,) in reader.execute(TABLES) if name not in OTHERWISE_KEPT]
    tables = [_table(reader, name) for name in names]
    return [table for table in tables if table.key]


def _table(reader: sqlite3.Connection, name: str) -> SealedTable:
    rows = reader.execute(f"PRAGMA main.table_info({name})").fetchall()
    types = {row[1]: row[2] for row in rows}
    key = [row[1] for row in sorted(rows, key=lambda row: row[5]) if row[5]]
    return SealedTable(name, types, key)


ROWS_AT_ONCE = 2000
"""Read in one look at the database: a short one does not make its log grow."""

Key = tuple[Any, ...]
"""Of a row, the columns that it is found by."""


@dataclass(frozen=True)
class Walk:
    """A way through a table, or through its seals.

    Parameters
    ----------
    source
        Statement for keys and whether the row is as it should be.
    keys
        Columns of the key, as the statement calls them.
    is_of_seals
        Whether seals are walked through, whose rows may be gone.
    """

    table: SealedTable
    source: str
    keys: str
    is_of_seals: bool

    def page(
        self, reader: Connection, log: DamageLog, after: Key | None, n_rows: int = ROWS_AT_ONCE
    ) -> Key | None:
        """Look at the rows behind a key, in its order; the last one's key, None if none was left.

        Altered rows are noted by the function that compares seals.
        """
        marks = ", ".join("?" * len(self.table.key))
        beyond = "" if after is None else f"WHERE ({self.keys}) > ({marks})"
        statement = f"{self.source} {beyond} ORDER BY {self.keys} LIMIT {n_rows}"
        rows = reader.execute(statement, after or ()).fetchall()
        if self.is_of_seals:
            for *key, is_there in rows:
                if not is_there:
                    log.note(Place(self.table.name, _words(self.table, key), is_missing=True))
        return tuple(rows[-1][:-1]) if rows else None


def walks(table: SealedTable) -> tuple[Walk, Walk]:
    """What there is to walk through: rows, for those altered, and seals, for rows that are gone."""
    keys, of_seals = _keys(table, "r."), _keys(table, "s.")
    row = f"SELECT 1 FROM main.{table.name} AS r WHERE {table.matched('s.', 'r.')}"  # noqa: S608
    rows = f"SELECT {keys}, {table.is_whole('r.')} FROM main.{table.name} AS r"  # noqa: S608
    seals = f"SELECT {of_seals}, EXISTS ({row}) FROM main.{table.seals} AS s"  # noqa: S608
    return (
        Walk(table, rows, keys, is_of_seals=False),
        Walk(table, seals, of_seals, is_of_seals=True),
    )


def _keys(table: SealedTable, of: str) -> str:
    return ", ".join(of + column for column in table.key)


def _words(table: SealedTable, key: Sequence[object]) -> str:
    words = ", ".join(f"{column} {cell}" for column, cell in zip(table.key, key, strict=True))
    return words.encode("utf-8", "replace").decode("utf-8")  # a damaged text may be none
