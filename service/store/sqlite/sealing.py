"""Seals in SQLite: made by triggers of the writer, looked at by views of the readers."""

import sqlite3
from collections.abc import Callable, Sequence

from service.store.seals.damage import DamageLog, Place
from service.store.seals.seal import FORMAT, Cell, begun, seal_of
from service.store.seals.table import IS_WHOLE, SEAL, WHOLE, SealedTable

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
        return ", ".join(f"{column} {_words(cell_of[column])}" for column in table.key)


def _sealed(name: str) -> Callable[..., int]:
    begun_with = begun(name)
    return lambda *cells: seal_of(begun_with, cells)


def _words(cell: object) -> str:
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
