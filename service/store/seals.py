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
"""Maximum number of places that are listed; further ones are only counted."""


@dataclass(frozen=True)
class Place:
    """Row that is damaged or missing.

    Parameters
    ----------
    key
        Key of the row as text.
    is_missing
        Whether the row is missing.
    """

    table: str
    key: str
    is_missing: bool = False


class DamageLog:
    """Damaged rows found since the start, each once; used from several threads.

    Parameters
    ----------
    most
        Maximum number of listed places.
    """

    def __init__(self, most: int = MAX_PLACES) -> None:
        self._most = most
        self._lock = Lock()
        self._places: dict[Place, None] = {}
        self._n_more = 0

    @property
    def n_damaged(self) -> int:
        """Number of damaged rows; beyond `most` a row that is found again may count again."""
        return len(self._places) + self._n_more

    @property
    def places(self) -> Sequence[Place]:
        """Damaged rows in the order in which they were found."""
        with self._lock:
            return list(self._places)

    def note(self, place: Place) -> None:
        """Add a damaged row."""
        with self._lock:
            if place in self._places:
                return
            if len(self._places) < self._most:
                self._places[place] = None
            else:
                self._n_more += 1


Cell = int | float | bytes | None
"""Value of a stored row; texts as bytes, since damaged text may not be UTF-8."""

FORMAT = 1
"""Format of checksums; those of another format are computed anew."""

_VERSION = 2
"""Version of `marshal`, which encodes types, lengths and all bits of numbers.

Later versions write repeated values as references, so that equal rows may differ."""


def initial_crc(table: str) -> int:
    """Return the initial value of the checksums of a table."""
    return zlib.crc32(table.encode())


def seal_of(begun_with: int, cells: tuple[Cell, ...]) -> int:
    """Return the CRC-32 of a row, continued from the initial value of its table."""
    return zlib.crc32(marshal.dumps(cells, _VERSION), begun_with)


SEAL, IS_WHOLE = "padwatch_seal_", "padwatch_is_whole_"
"""SQL functions of padwatch's connections, one per table for speed."""

WHOLE = "whole_"
"""Prefix of views that omit damaged rows also on a writing connection."""


@dataclass(frozen=True)
class SealedTable:
    """Table with checksums of its rows.

    Parameters
    ----------
    types
        Types of the columns, in their order.
    key
        Columns of the key.
    """

    name: str
    types: Mapping[str, str]
    key: Sequence[str]

    @property
    def columns(self) -> Sequence[str]:
        """Names of the columns, in their order."""
        return list(self.types)

    @property
    def seals(self) -> str:
        """Name of the table with the checksums."""
        return f"seal_{self.name}"

    @cached_property
    def create(self) -> Sequence[str]:
        """Statements that create the table of checksums and fill it."""
        keys = ", ".join(self.key)
        # with the same types, since the index is not used otherwise
        typed = ", ".join(f"{column} {self.types[column]} NOT NULL" for column in self.key)
        return (
            f"CREATE TABLE {self.seals} ({typed}, seal INTEGER NOT NULL, PRIMARY KEY ({keys}))"
            " STRICT, WITHOUT ROWID",
            f"INSERT INTO {self.seals} SELECT {keys}, {self._seal('')} FROM {self.name}",  # noqa: S608
        )

    @cached_property
    def triggers(self) -> Sequence[str]:
        """Statements by which this connection maintains the checksums."""
        keys = ", ".join(self.key)
        put = (
            f"INSERT INTO {self.seals} VALUES ({self._listed('NEW.')}, {self._seal('NEW.')})"  # noqa: S608
            f" ON CONFLICT ({keys}) DO UPDATE SET seal = excluded.seal;"
        )
        forget = f"DELETE FROM {self.seals} WHERE {self.matched('OLD.')};"  # noqa: S608
        bodies = {"INSERT": put, "UPDATE": forget + put, "DELETE": forget}
        return [
            f"CREATE TEMP TRIGGER sealed_{self.name}_{change.lower()} AFTER {change} ON"
            f" main.{self.name} BEGIN {body} END"
            for change, body in bodies.items()
        ]

    def view(self, before: str = "") -> str:
        """Return the statement by which this connection sees intact rows only, under a name."""
        listed = ", ".join(f"r.{column} AS {column}" for column in self.columns)
        return (
            f"CREATE TEMP VIEW {before}{self.name} AS SELECT {listed}"  # noqa: S608
            f" FROM main.{self.name} AS r WHERE {self.is_whole('r.')}"
        )

    def is_whole(self, of: str) -> str:
        """Return the expression that a row fits its checksum."""
        seal = f"SELECT s.seal FROM main.{self.seals} AS s WHERE {self.matched(of, 's.')}"  # noqa: S608
        return f"{IS_WHOLE}{self.name}(({seal}), {self._cells(of)})"

    def matched(self, of: str, ours: str = "") -> str:
        """Return the expression that a row has the key of a checksum."""
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
"""Tables whose rows have checksums of their own, or only list pending work."""

SCHEMA = "CREATE TABLE IF NOT EXISTS seal_schema (id INTEGER PRIMARY KEY, number INTEGER)"
SEALED_AT = "SELECT number FROM seal_schema WHERE id = 1"
SET_SEALED_AT = "INSERT OR REPLACE INTO seal_schema VALUES (1, ?)"
"""An upgrade may change rows, so checksums of an older schema are computed anew."""
PER_FORMAT = 1_000_000
"""Factor of the format in that number."""

WALK = "CREATE TABLE IF NOT EXISTS seal_walk (id INTEGER PRIMARY KEY, place TEXT)"
"""Table with the progress of the check of all rows."""

TABLES = """
    SELECT name FROM main.sqlite_master
    WHERE type = 'table' AND name NOT GLOB 'sqlite_*' AND name NOT GLOB 'seal_*' ORDER BY name
"""


class Seals:
    """Checksums of one database file.

    Parameters
    ----------
    damage
        Receives rows that do not fit their checksums.
    """

    def __init__(self, damage: DamageLog) -> None:
        self._damage = damage
        self.tables: dict[str, SealedTable] = {}

    def begin(self, writer: sqlite3.Connection) -> None:
        """Create missing checksums within a transaction, and maintain them on this connection."""
        self.tables = {table.name: table for table in _tables(writer)}
        self.register_functions(writer)
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

    def load(self, reader: sqlite3.Connection) -> None:
        """Read which tables have checksums, in a database that another process may be writing."""
        there = {name for (name,) in reader.execute("SELECT name FROM main.sqlite_master")}
        self.tables = {t.name: t for t in _tables(reader) if t.seals in there}
        self.register_functions(reader)

    def install_views(self, reader: sqlite3.Connection) -> None:
        """Let a connection see intact rows only."""
        self.register_functions(reader)
        for table in self.tables.values():
            reader.execute(table.view())
            reader.execute(table.view(WHOLE))

    def register_functions(self, connection: sqlite3.Connection) -> None:
        """Register the functions that compute checksums on a connection."""
        for name in self.tables:
            connection.create_function(SEAL + name, -1, _sealed(name), deterministic=True)
            is_whole = self._is_whole(name)
            connection.create_function(IS_WHOLE + name, -1, is_whole, deterministic=True)

    def _is_whole(self, name: str) -> Callable[..., bool]:
        begun_with = initial_crc(name)

        def is_whole(seal: int | None, *cells: Cell) -> bool:
            return seal_of(begun_with, cells) == seal or self._noted(name, cells)

        return is_whole

    def _noted(self, name: str, cells: Sequence[Cell]) -> bool:
        self._damage.note(Place(name, self.key_of(name, cells)))
        return False

    def key_of(self, name: str, cells: Sequence[object]) -> str:
        """Return the key of a row as text."""
        table = self.tables[name]
        cell_of = dict(zip(table.columns, cells, strict=True))
        return ", ".join(f"{column} {_cell_words(cell_of[column])}" for column in table.key)


def _sealed(name: str) -> Callable[..., int]:
    begun_with = initial_crc(name)
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
"""Rows per transaction: a short one does not make the log grow."""

Key = tuple[Any, ...]
"""Values of the key of a row."""


@dataclass(frozen=True)
class Walk:
    """Walk through a table or its checksums, in order of the key.

    Parameters
    ----------
    source
        Statement for keys, and whether the row is as it should be.
    keys
        Columns of the key in the statement.
    is_of_seals
        Whether checksums are read, whose rows may be missing.
    """

    table: SealedTable
    source: str
    keys: str
    is_of_seals: bool

    def page(
        self, reader: Connection, log: DamageLog, after: Key | None, n_rows: int = ROWS_AT_ONCE
    ) -> Key | None:
        """Check the rows after a key; return the last key, or None at the end.

        The SQL function that compares checksums adds altered rows to the log.
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
    """Return the walks through rows, for altered ones, and through checksums, for missing ones."""
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
    return words.encode("utf-8", "replace").decode("utf-8")  # damaged text may not be UTF-8
