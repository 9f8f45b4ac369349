"""Rows of SQLite compared with their seals."""

import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from service.store.database import Connection
from service.store.seals import (
    FORMAT,
    IS_WHOLE,
    SEAL,
    WHOLE,
    Cell,
    DamageLog,
    Place,
    SealedTable,
    begun,
    seal_of,
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
