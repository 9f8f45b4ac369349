"""Search for damage in a SQLite database: its structure, its rows, and the high-water mark."""

import json
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.store.database import Connection, Database
from service.store.highwater.commits import compared, host_id, select_mark
from service.store.highwater.mark import Mark, MarkError, MarkFile, mark_path
from service.store.port import StoreError
from service.store.seals import DamageLog, Key, Place, Seals, Walk, walks
from service.store.sqlite.connections import BUSY_TIMEOUT_S
from service.store.sqlite.file import is_of_the_data

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


ROWS_AT_ONCE = 500
"""A few milliseconds, after which the log beside the file may be brought into it."""

HEX = "hex"
REMEMBER_EVERY = 300
"""Looks, after which it is written down how far it has come."""

RECALL = "SELECT place FROM main.seal_walk WHERE id = 1"
REMEMBER = """
    INSERT INTO seal_walk VALUES (1, ?) ON CONFLICT (id) DO UPDATE SET place = excluded.place
"""


class Scrubber:
    """Goes on, also after a restart, where it has been last; used by one thread at a time.

    Parameters
    ----------
    damage
        Is told of rows that are altered or gone.
    """

    def __init__(self, database: Database, seals: Seals, damage: DamageLog) -> None:
        self._database, self._damage = database, damage
        self._walks = [walk for table in seals.tables.values() for walk in walks(table)]
        self._number = -1
        self._after: Key | None = None
        self._n_looks = 0

    def look_on(self) -> bool:
        """Look at some rows; whether that was once around.

        Raises
        ------
        StoreError
            If the database cannot be used now.
        """
        if self._number < 0:
            self._recall()
        if not self._walks:
            return True
        self._after = self._looked(self._walks[self._number])
        if self._after is None:
            self._number = (self._number + 1) % len(self._walks)
        is_around = self._after is None and self._number == 0
        self._n_looks += 1
        if is_around or self._n_looks % REMEMBER_EVERY == 0:
            self._remember()
        return is_around

    def _looked(self, walk: Walk) -> Key | None:
        try:
            with self._database.reading("surrogateescape") as reader:
                return walk.page(reader, self._damage, self._after, ROWS_AT_ONCE)
        except (StoreError, UnicodeEncodeError) as error:
            if isinstance(error, StoreError) and not is_of_the_data(error.__cause__):
                raise
            what = repr(str(error.__cause__ or error)[:80])
            self._damage.note(Place(walk.table.name, f"cannot be read any further: {what}"))
            return None

    def _recall(self) -> None:
        with self._database.reading() as reader:
            self._number, self._after = _place(self._walks, reader)

    def _remember(self) -> None:
        walk = self._walks[self._number]
        after = None if self._after is None else [_told(cell) for cell in self._after]
        written = json.dumps([walk.table.name, walk.is_of_seals, after])
        with self._database.writing() as writer:
            writer.execute(REMEMBER, (written,))


def _place(ways: list[Walk], reader: Connection) -> tuple[int, Key | None]:
    """Where to go on; at the beginning if nobody knows, for nothing depends on it."""
    row = reader.execute(RECALL).fetchone()
    try:
        name, is_of_seals, after = json.loads(row[0]) if row else (None, False, None)
    except (TypeError, ValueError):
        return 0, None
    for number, walk in enumerate(ways):
        if (walk.table.name, walk.is_of_seals) == (name, is_of_seals) and _is_key(walk, after):
            return number, None if after is None else tuple(_cell(told) for told in after)
    return 0, None


def _told(cell: Any) -> Any:
    """A cell of a key as JSON can hold it; the keys of sessions are bytes."""
    return {HEX: cell.hex()} if isinstance(cell, bytes) else cell


def _cell(told: Any) -> Any:
    return bytes.fromhex(told[HEX]) if isinstance(told, dict) else told


def _is_key(walk: Walk, after: Any) -> bool:
    if after is None:
        return True
    fits = isinstance(after, list) and len(after) == len(walk.table.key)
    return fits and all(isinstance(told, int | float | str) or _is_hex(told) for told in after)


def _is_hex(told: Any) -> bool:
    is_one = isinstance(told, dict) and list(told) == [HEX] and isinstance(told[HEX], str)
    return is_one and re.fullmatch("([0-9a-f]{2})*", told[HEX]) is not None
