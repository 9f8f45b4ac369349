"""Looking for damage that nobody has met: structure, seals, rows that are gone, the newest mark."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from service.store.highwater.commits import select_mark
from service.store.highwater.comparison import compared
from service.store.highwater.file import MarkError, MarkFile, mark_path
from service.store.highwater.host import host_id
from service.store.highwater.mark import Mark
from service.store.port import StoreError
from service.store.seals.damage import DamageLog
from service.store.seals.table import SealedTable
from service.store.sqlite.readers import BUSY_TIMEOUT_S
from service.store.sqlite.sealing import Seals

ROWS_AT_ONCE = 2000
"""Read in one look at the database: a short one does not make its log grow."""

EVERY = 1_000_000
NULL_QUIRK = "NULL value in "
"""What SQLite before 3.41 finds in tables WITHOUT ROWID where nothing is wrong."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong.

    Parameters
    ----------
    kind
        "structure", "altered", "missing" or "high_water".
    """

    kind: str
    detail: str


def findings(path: Path, told: Callable[[float], None] = lambda _: None) -> Iterator[Finding]:
    """Read a database from end to end, also while padwatch writes to it; what is wrong with it.

    Parameters
    ----------
    told
        Called with the share that has been done.

    Raises
    ------
    StoreError
        If it cannot be read at all.
    """
    if not path.exists():
        raise StoreError(f"{path.absolute()}: there is no database")
    said = _mark_beside(path)  # first: it may lag, but not lead
    log = DamageLog()
    seals = Seals(log)
    uri = f"{path.absolute().as_uri()}?mode=ro"
    try:
        with closing(
            sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        ) as reader:
            yield from _structure(reader)
            seals.know(reader)
            yield from _rows(reader, seals, log, told)
            mark = select_mark(reader)
            if mark is not None:
                for found in compared(said, mark, host_id()):
                    yield Finding("high_water", found.detail)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        yield Finding("structure", f"cannot be read any further: {error}")


def _mark_beside(path: Path) -> Mark | str:
    try:
        return MarkFile(mark_path(path)).read()
    except MarkError as error:
        return str(error)


def _structure(reader: sqlite3.Connection) -> Iterator[Finding]:
    for (line,) in reader.execute(f"PRAGMA integrity_check({EVERY})"):
        if line != "ok" and not line.startswith(NULL_QUIRK):
            yield Finding("structure", line)


def _rows(
    reader: sqlite3.Connection, seals: Seals, log: DamageLog, told: Callable[[float], None]
) -> Iterator[Finding]:
    tables = list(seals.tables.values())
    for done, table in enumerate(tables):
        told(done / len(tables))
        for _ in _whole(reader, table):
            pass
        yield from _gone(reader, table)
    told(1.0)
    for place in log.places:
        yield Finding("altered", f"{place.table}: {place.key}")


def _whole(reader: sqlite3.Connection, table: SealedTable) -> Iterator[None]:
    """Look at every row, some at a time; those that do not fit are noted by the function."""
    source = f"SELECT {_keys(table, 'r.')}, {table.is_whole('r.')} FROM main.{table.name} AS r"  # noqa: S608
    for _ in _paged(reader, table, source, "r."):
        yield


def _gone(reader: sqlite3.Connection, table: SealedTable) -> Iterator[Finding]:
    row = f"SELECT 1 FROM main.{table.name} AS r WHERE {table.matched('s.', 'r.')}"  # noqa: S608
    source = f"SELECT {_keys(table, 's.')}, EXISTS ({row}) FROM main.{table.seals} AS s"  # noqa: S608
    for *key, is_there in _paged(reader, table, source, "s."):
        if not is_there:
            words = ", ".join(f"{c} {v}" for c, v in zip(table.key, key, strict=True))
            yield Finding("missing", f"{table.name}: {words}")


def _paged(
    reader: sqlite3.Connection, table: SealedTable, source: str, of: str
) -> Iterator[tuple[object, ...]]:
    """Rows in the order of their keys, some at a time."""
    keys, marks = _keys(table, of), ", ".join("?" * len(table.key))
    ordered = f" ORDER BY {keys} LIMIT {ROWS_AT_ONCE}"
    rows = reader.execute(source + ordered).fetchall()
    while rows:
        yield from rows
        last = rows[-1][: len(table.key)]
        rows = reader.execute(f"{source} WHERE ({keys}) > ({marks}){ordered}", last).fetchall()


def _keys(table: SealedTable, of: str) -> str:
    return ", ".join(of + column for column in table.key)
