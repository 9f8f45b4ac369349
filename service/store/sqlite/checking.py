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
from service.store.seals import DamageLog
from service.store.sqlite.readers import BUSY_TIMEOUT_S
from service.store.sqlite.sealing import Key, Seals, walks

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
    log = DamageLog(EVERY)
    seals = Seals(log)
    uri = f"{path.absolute().as_uri()}?mode=ro"
    try:
        with closing(
            sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        ) as reader:
            mark = _mark_inside(reader)  # now: a running service moves both on
            yield from _structure(reader)
            seals.know(reader)
            _look_at_rows(reader, seals, log, told)
            mark = mark or select_mark(reader)
            if mark is not None:
                for found in compared(said, mark, host_id()):
                    yield Finding("high_water", found.detail)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        yield Finding("structure", f"cannot be read any further: {error}")
    yield from _said(log)


def _mark_beside(path: Path) -> Mark | str:
    try:
        return MarkFile(mark_path(path)).read()
    except MarkError as error:
        return str(error)


def _mark_inside(reader: sqlite3.Connection) -> Mark | None:
    try:
        return select_mark(reader)
    except (sqlite3.Error, UnicodeDecodeError):
        return None  # asked again at the end: damage elsewhere is told all the same


def _structure(reader: sqlite3.Connection) -> Iterator[Finding]:
    for (line,) in reader.execute(f"PRAGMA integrity_check({EVERY})"):
        if line != "ok" and not line.startswith(NULL_QUIRK):
            yield Finding("structure", line)


def _look_at_rows(
    reader: sqlite3.Connection, seals: Seals, log: DamageLog, told: Callable[[float], None]
) -> None:
    tables = list(seals.tables.values())
    for done, table in enumerate(tables):
        told(done / len(tables))
        for walk in walks(table):
            after: Key | None = None
            while (after := walk.page(reader, log, after)) is not None:
                pass
    told(1.0)


def _said(log: DamageLog) -> Iterator[Finding]:
    for is_missing, kind in ((True, "missing"), (False, "altered")):
        for place in log.places:
            if place.is_missing == is_missing:
                yield Finding(kind, f"{place.table}: {place.key}")
