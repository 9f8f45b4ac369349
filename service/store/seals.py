"""Checksums of stored rows (seals), and detection of damaged and missing rows."""

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
"""Maximum number of damaged rows that are listed; further damaged rows are only counted."""


@dataclass(frozen=True)
class Place:
    """Table and key, as text, of a damaged or missing row.

    Parameters
    ----------
    is_missing
        Whether the row is missing; False if the row is damaged.
    """

    table: str
    key: str
    is_missing: bool = False


class DamageLog:
    """Thread-safe list of up to `most` damaged and missing rows found since the start."""

    def __init__(self, most: int = MAX_PLACES) -> None:
        self._most = most
        self._lock = Lock()
        self._places: dict[Place, None] = {}
        self._n_more = 0

    @property
    def n_damaged(self) -> int:
        """Number of damaged or missing rows; rows that are not listed may count several times."""
        return len(self._places) + self._n_more

    @property
    def places(self) -> Sequence[Place]:
        """Listed damaged and missing rows in the order in which they were found."""
        with self._lock:
            return list(self._places)

    def note(self, place: Place) -> None:
        """List a damaged or missing row once; if the list is full, only count the row."""
        with self._lock:
            if place in self._places:
                return
            if len(self._places) < self._most:
                self._places[place] = None
            else:
                self._n_more += 1


Cell = int | float | bytes | None
"""Column value of a stored row; text as bytes, since damaged text may not be UTF-8."""

FORMAT = 1
"""Version of the checksum format; checksums of another version are recomputed."""

_VERSION = 2
"""`marshal` version with which rows are encoded, including types, lengths and all bits.

Later versions encode repeated values as references, so that equal rows could differ."""


def initial_crc(table: str) -> int:
    """Return the initial CRC-32 for the rows of a table."""
    return zlib.crc32(table.encode())


def seal_of(begun_with: int, cells: tuple[Cell, ...]) -> int:
    """Return the CRC-32 of a row; `begun_with` is the initial CRC-32 of its table."""
    return zlib.crc32(marshal.dumps(cells, _VERSION), begun_with)


SEAL, IS_WHOLE = "padwatch_seal_", "padwatch_is_whole_"
"""Name prefixes of the SQL functions that compute and check checksums; one pair per table."""

WHOLE = "whole_"
"""Name prefix of the views without damaged rows; writing connections also have these views."""


@dataclass(frozen=True)
class SealedTable:
    """Table whose rows have checksums, which are stored in a separate table.

    Parameters
    ----------
    types
        SQL types by column name, in column order.
    key
        Names of the primary key columns.
    """

    name: str
    types: Mapping[str, str]
    key: Sequence[str]

    @property
    def columns(self) -> Sequence[str]:
        """Column names, in column order."""
        return list(self.types)

    @property
    def seals(self) -> str:
        """Name of the checksum table."""
        return f"seal_{self.name}"

    @cached_property
    def create(self) -> Sequence[str]:
        """Statements that create and fill the checksum table."""
        keys = ", ".join(self.key)
        # the key has the same types as in the table; otherwise SQLite does not use the index
        typed = ", ".join(f"{column} {self.types[column]} NOT NULL" for column in self.key)
        return (
            f"CREATE TABLE {self.seals} ({typed}, seal INTEGER NOT NULL, PRIMARY KEY ({keys}))"
            " STRICT, WITHOUT ROWID",
            f"INSERT INTO {self.seals} SELECT {keys}, {self._seal('')} FROM {self.name}",  # noqa: S608
        )

    @cached_property
    def triggers(self) -> Sequence[str]:
        """Statements that create the temporary triggers that update the checksums."""
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
        """Return the statement that creates a temporary view of the intact rows.

        The name of the view is the prefix `before` and the name of the table.
        """
        listed = ", ".join(f"r.{column} AS {column}" for column in self.columns)
        return (
            f"CREATE TEMP VIEW {before}{self.name} AS SELECT {listed}"  # noqa: S608
            f" FROM main.{self.name} AS r WHERE {self.is_whole('r.')}"
        )

    def is_whole(self, of: str) -> str:
        """Return the SQL condition that a row matches its checksum.

        `of` is the prefix of the row's columns in the query, such as ``r.``.
        """
        seal = f"SELECT s.seal FROM main.{self.seals} AS s WHERE {self.matched(of, 's.')}"  # noqa: S608
        return f"{IS_WHOLE}{self.name}(({seal}), {self._cells(of)})"

    def matched(self, of: str, ours: str = "") -> str:
        """Return the SQL condition that a row and a checksum have equal keys.

        `of` and `ours` are the prefixes of their columns in the query, such as ``r.`` and ``s.``.
        """
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
"""Tables without row checksums: the rows contain a checksum, or only list pending work."""

SCHEMA = "CREATE TABLE IF NOT EXISTS seal_schema (id INTEGER PRIMARY KEY, number INTEGER)"
SEALED_AT = "SELECT number FROM seal_schema WHERE id = 1"
SET_SEALED_AT = "INSERT OR REPLACE INTO seal_schema VALUES (1, ?)"
"""Statement that writes the number of the schema and format of the checksums. The checksums are
recomputed if the number has changed, since a migration may change rows."""
PER_FORMAT = 1_000_000
"""Factor in the stored number of schema and format, ``format * PER_FORMAT + schema``."""

WALK = "CREATE TABLE IF NOT EXISTS seal_walk (id INTEGER PRIMARY KEY, place TEXT)"
"""Statement that creates the table with the progress of `Scrubber`."""

TABLES = """
    SELECT name FROM main.sqlite_master
    WHERE type = 'table' AND name NOT GLOB 'sqlite_*' AND name NOT GLOB 'seal_*' ORDER BY name
"""


class Seals:
    """Row checksums of one database file; rows that do not match are added to the log `damage`."""

    def __init__(self, damage: DamageLog) -> None:
        self._damage = damage
        self.tables: dict[str, SealedTable] = {}

    def begin(self, writer: sqlite3.Connection) -> None:
        """Create missing and outdated checksums; add triggers and views to the connection."""
        self.tables = {table.name: table for table in _tables(writer)}
        self.register_functions(writer)
        (schema,) = writer.execute("PRAGMA main.user_version").fetchone()
        now = (FORMAT * PER_FORMAT + schema,)
        writer.execute(SCHEMA)
        writer.execute(WALK)
        if writer.execute(SEALED_AT).fetchone() != now:
            for table in self.tables.values():
                writer.execute(f"DROP TABLE IF EXISTS {table.seals}")
                for statement in table.create:
                    writer.execute(statement)
            writer.execute(SET_SEALED_AT, now)
        for table in self.tables.values():
            for statement in (*table.triggers, table.view(WHOLE)):
                writer.execute(statement)

    def load(self, reader: sqlite3.Connection) -> None:
        """Find the tables that have checksums; another process may be writing to the database."""
        there = {name for (name,) in reader.execute("SELECT name FROM main.sqlite_master")}
        self.tables = {t.name: t for t in _tables(reader) if t.seals in there}
        self.register_functions(reader)

    def install_views(self, reader: sqlite3.Connection) -> None:
        """Create views on a connection that hide damaged rows."""
        self.register_functions(reader)
        for table in self.tables.values():
            reader.execute(table.view())
            reader.execute(table.view(WHOLE))

    def register_functions(self, connection: sqlite3.Connection) -> None:
        """Register the SQL functions that compute and check checksums on a connection."""
        for name in self.tables:
            connection.create_function(SEAL + name, -1, _sealed(name), deterministic=True)
            is_whole = self._is_whole(name)
            connection.create_function(IS_WHOLE + name, -1, is_whole, deterministic=True)

    def _is_whole(self, name: str) -> Callable[..., bool]:
        begun_with = initial_crc(name)

        def is_whole(seal: int | None, *cells: Cell) -> bool:
            # as `seal_of`, whose call would take a fifth of the time of reading a year of trends
            found = zlib.crc32(marshal.dumps(cells, _VERSION), begun_with)
            return found == seal or self._noted(name, cells)

        return is_whole

    def _noted(self, name: str, cells: Sequence[Cell]) -> bool:
        self._damage.note(Place(name, self.key_of(name, cells)))
        return False

    def key_of(self, name: str, cells: Sequence[object]) -> str:
        """Return the key of a row as text, given the table name and all columns of the row."""
        table = self.tables[name]
        cell_of = dict(zip(table.columns, cells, strict=True))
        return ", ".join(f"{column} {_cell_words(cell_of[column])}" for column in table.key)


def unchecked(reader: Connection, table: str) -> str:
    """Return the name in SQL of a table with all its rows, including damaged rows."""
    return f"main.{table}" if isinstance(reader, sqlite3.Connection) else table


def select_whole(
    reader: Connection, table: str, where: str, parameters: Mapping[str, object]
) -> list[tuple[Any, ...]]:
    """Return all columns of the intact rows of a table; the keys of damaged rows are logged.

    Parameters
    ----------
    where
        SQL from ``WHERE`` on, including the order; only columns of the primary key may occur, and
        no text from users.
    parameters
        Values of the placeholders in `where`, by name.
    """
    if isinstance(reader, sqlite3.Connection):  # PostgreSQL has checksums of its pages
        statement = f"SELECT seal FROM main.seal_{table} {where}"  # noqa: S608
        seals = [seal for (seal,) in reader.execute(statement, parameters)]
        rows = reader.execute(f"SELECT * FROM main.{table} {where}", parameters).fetchall()  # noqa: S608
        begun_with, dumps, crc = initial_crc(table), marshal.dumps, zlib.crc32
        # a row does not match the checksum of another row, since its key is part of it
        if [crc(dumps(row, _VERSION), begun_with) for row in rows] == seals:
            return rows
    return reader.execute(f"SELECT * FROM whole_{table} {where}", parameters).fetchall()  # noqa: S608


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
"""Number of rows per query of a check; short read transactions keep the WAL file small."""

Key = tuple[Any, ...]
"""Values of the primary key columns of a row."""


@dataclass(frozen=True)
class Walk:
    """Check of all rows of a table, or of all checksums of its rows, in order of the primary key.

    Parameters
    ----------
    source
        SQL query of the key columns and a flag. The flag states whether the row is intact, or,
        in a query of checksums, whether the row exists.
    keys
        Key columns in the query, separated by commas.
    is_of_seals
        Whether the checksum table is read, to find missing rows.
    """

    table: SealedTable
    source: str
    keys: str
    is_of_seals: bool

    def page(
        self, reader: Connection, log: DamageLog, after: Key | None, n_rows: int = ROWS_AT_ONCE
    ) -> Key | None:
        """Check up to `n_rows` rows after a key; return the last key, None if no row is left.

        Altered and missing rows are added to the log; `after` is None to begin.
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
    """Return two checks: of the rows, which finds altered rows; of the checksums, missing rows."""
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
