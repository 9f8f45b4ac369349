"""Letting a copy that was put in a database's place be the newest, because somebody wanted it."""

import sqlite3
from contextlib import closing
from pathlib import Path

from service.store.highwater.commits import select_mark
from service.store.highwater.file import MarkFile, mark_path
from service.store.highwater.mark import Mark


def adopt_restored(database: Path) -> None:
    """Have the mark beside a database say what the database does.

    Raises
    ------
    OSError
        If the disk refuses; then the next start finds the database older than the mark.
    sqlite3.Error
        If the database cannot be read.
    """
    mark = _mark_of(database)
    file = MarkFile(mark_path(database))
    if mark is None:  # a copy from before there were marks: it gets one when it is opened
        file.path.unlink(missing_ok=True)
    else:
        file.replace(mark)


def _mark_of(database: Path) -> Mark | None:
    # nobody writes to it yet: no journal is looked for or left behind
    uri = f"{database.absolute().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as reader:
        has_one = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'high_water'"
        return select_mark(reader) if reader.execute(has_one).fetchone() else None
