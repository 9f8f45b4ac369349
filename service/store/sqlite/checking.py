"""Integrity check of a SQLite database: structure, row checksums, and high-water mark."""

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
NULL_FINDING = "NULL value in "


@dataclass(frozen=True)
class Finding:
    """Defect of a database.

    `kind` is "structure", "altered" (row), "missing" (row) or "high_water"; `detail` a sentence.
    """

    kind: str
    detail: str


def findings(path: Path, progress: Callable[[float], None] = lambda _: None) -> Iterator[Finding]:
    """Check a database completely and yield its defects; padwatch may be writing to it.

    Parameters
    ----------
    progress
        Function that receives the completed fraction, 0 to 1.

    Raises
    ------
    StoreError
        If the file does not exist.
    """
    if not path.exists():
        raise StoreError(f"{path.absolute()}: the database does not exist; check data_folder")
    in_file = _mark_beside(path)  # read before the database, which may be ahead of it
    log = DamageLog(EVERY)
    seals = Seals(log)
    uri = f"{path.absolute().as_uri()}?mode=ro"
    try:
        with closing(
            sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        ) as reader:
            mark = _mark_inside(reader)  # read early: a running service changes both marks
            yield from (Finding("structure", each) for each in structure_findings(reader))
            seals.load(reader)
            _look_at_rows(reader, seals, log, progress)
            mark = mark or select_mark(reader)
            if mark is not None:
                for found in compared(in_file, mark, host_id()):
                    yield Finding("high_water", found.detail)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        yield Finding("structure", f"the database cannot be read further: {error}")
    yield from _damage(log)


def _mark_beside(path: Path) -> Mark | str:
    try:
        return MarkFile(mark_path(path)).read()
    except MarkError as error:
        return str(error)


def _mark_inside(reader: sqlite3.Connection) -> Mark | None:
    try:
        return select_mark(reader)
    except (sqlite3.Error, UnicodeDecodeError):
        return None  # read again at the end, after the structure check


def structure_findings(connection: sqlite3.Connection) -> Iterator[str]:
    """Yield a description of each structural defect of a database.

    NULL values that SQLite reports are verified by a query, since SQLite before 3.41 reports them
    falsely in WITHOUT ROWID tables.
    """
    nulls = set()
    for (finding,) in connection.execute(f"PRAGMA integrity_check({EVERY})"):
        if finding.startswith(NULL_FINDING):
            nulls.add(finding)
        elif finding != "ok":
            yield finding
    for finding in sorted(nulls):
        table, _, column = finding.removeprefix(NULL_FINDING).partition(".")
        is_null = f'SELECT 1 FROM "{table}" WHERE typeof("{column}") = \'null\' LIMIT 1'  # noqa: S608
        if connection.execute(is_null).fetchone() is not None:
            yield finding


def _look_at_rows(
    reader: sqlite3.Connection, seals: Seals, log: DamageLog, progress: Callable[[float], None]
) -> None:
    tables = list(seals.tables.values())
    for done, table in enumerate(tables):
        progress(done / len(tables))
        for walk in walks(table):
            after: Key | None = None
            while (after := walk.page(reader, log, after)) is not None:
                pass
    progress(1.0)


def _damage(log: DamageLog) -> Iterator[Finding]:
    for is_missing, kind in ((True, "missing"), (False, "altered")):
        for place in log.places:
            if place.is_missing == is_missing:
                yield Finding(kind, f"{place.table}: {place.key}")


ROWS_AT_ONCE = 500
"""Number of rows per read transaction, which takes milliseconds and rarely delays a checkpoint."""

HEX = "hex"
REMEMBER_EVERY = 300
"""Number of calls of `check_some` between two writes of the progress to the database."""

RECALL = "SELECT place FROM main.seal_walk WHERE id = 1"
REMEMBER = """
    INSERT INTO seal_walk VALUES (1, ?) ON CONFLICT (id) DO UPDATE SET place = excluded.place
"""


class Scrubber:
    """Cyclic checksum check of all rows, resumed after a restart; used by one thread at a time.

    Altered and missing rows are added to the log `damage`.
    """

    def __init__(self, database: Database, seals: Seals, damage: DamageLog) -> None:
        self._database, self._damage = database, damage
        self._walks = [walk for table in seals.tables.values() for walk in walks(table)]
        self._number = -1
        self._after: Key | None = None
        self._n_looks = 0

    def check_some(self) -> bool:
        """Check the next rows; return True if the check of all rows is then complete.

        Raises `StoreError` if the database is temporarily unusable.
        """
        if self._number < 0:
            with self._database.reading() as reader:
                self._number, self._after = _place(self._walks, reader)
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
            self._damage.note(Place(walk.table.name, f"cannot be read further: {what}"))
            return None

    def _remember(self) -> None:
        walk = self._walks[self._number]
        after = None if self._after is None else [_json_cell(cell) for cell in self._after]
        written = json.dumps([walk.table.name, walk.is_of_seals, after])
        with self._database.writing() as writer:
            writer.execute(REMEMBER, (written,))


def _place(ways: list[Walk], reader: Connection) -> tuple[int, Key | None]:
    """Return the number and the last key of the check to resume; 0 and None if unknown."""
    row = reader.execute(RECALL).fetchone()
    try:
        name, is_of_seals, after = json.loads(row[0]) if row else (None, False, None)
    except (TypeError, ValueError):
        return 0, None
    for number, walk in enumerate(ways):
        if (walk.table.name, walk.is_of_seals) == (name, is_of_seals) and _is_key(walk, after):
            return number, None if after is None else tuple(_cell(stored) for stored in after)
    return 0, None


def _json_cell(cell: Any) -> Any:
    """Return a key value as a JSON value, with bytes, such as session keys, in hexadecimal."""
    return {HEX: cell.hex()} if isinstance(cell, bytes) else cell


def _cell(stored: Any) -> Any:
    return bytes.fromhex(stored[HEX]) if isinstance(stored, dict) else stored


def _is_key(walk: Walk, after: Any) -> bool:
    if after is None:
        return True
    fits = isinstance(after, list) and len(after) == len(walk.table.key)
    return fits and all(
        isinstance(stored, int | float | str) or _is_hex(stored) for stored in after
    )


def _is_hex(stored: Any) -> bool:
    is_one = isinstance(stored, dict) and list(stored) == [HEX] and isinstance(stored[HEX], str)
    return is_one and re.fullmatch("([0-9a-f]{2})*", stored[HEX]) is not None
