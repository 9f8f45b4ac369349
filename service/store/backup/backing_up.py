"""`back_up`: a copy of the database while the service writes to it."""

import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from core.units import s_from_ns
from service.runtime.files import create_private, put_in_place
from service.store.backup.check import BackupError, Content, alone_in, checked, content_of

BUSY_TIMEOUT_S = 30.0

NAME = re.compile(r"padwatch-\d{8}T\d{6}Z\.sqlite3")


@dataclass(frozen=True)
class Backup:
    """A copy that has been verified.

    Parameters
    ----------
    removed
        Older copies that have made room for it.
    """

    path: Path
    n_bytes: int
    content: Content
    removed: tuple[Path, ...]


def back_up(database: Path, folder: Path, now_ns: int, n_kept: int) -> Backup:
    """Copy a database by SQLite's online backup, verify the copy, and remove the oldest ones.

    Nothing old is removed before the new copy is whole and on the disk.

    Parameters
    ----------
    folder
        Of the copies; created if need be.
    n_kept
        Copies that there are afterwards, at least 1.

    Raises
    ------
    BackupError
        If there is no verified copy; then the folder is as it was.
    """
    if not database.is_file():
        raise BackupError(f"{database}: there is no such database")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with alone_in(folder):
            return _back_up(database, folder, now_ns, n_kept)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{folder}: the backup of {database} failed: {error}") from error


def _back_up(database: Path, folder: Path, now_ns: int, n_kept: int) -> Backup:
    path = folder / _name(now_ns)
    aside = folder / f".{path.name}.part"
    for leftover in folder.glob(".padwatch-*.sqlite3.part*"):
        leftover.unlink()
    create_private(aside)
    try:
        expected = _copy(database, aside)
        found = checked(aside)
        if found != expected:
            raise BackupError(f"{aside} does not hold what {database} held: {found}, {expected}")
        put_in_place(aside, path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
    return Backup(path, path.stat().st_size, found, _make_room(path, n_kept))


def _copy(database: Path, aside: Path) -> Content:
    """Copy what one moment's database holds; return what that is."""
    uri = f"{database.absolute().as_uri()}?mode=ro"
    with (
        closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as source,
        closing(sqlite3.connect(aside, isolation_level=None)) as target,
    ):
        source.execute("BEGIN")  # counting and copying see the same moment
        content = content_of(source)
        source.backup(target)
        target.execute("PRAGMA journal_mode = DELETE")  # one file, without a log beside it
    return content


def _make_room(newest: Path, n_kept: int) -> tuple[Path, ...]:
    """Remove the oldest copies, never the one that has just been made."""
    others = (path for path in newest.parent.iterdir() if NAME.fullmatch(path.name))
    older = sorted((path for path in others if path != newest), reverse=True)
    for path in older[n_kept - 1 :]:
        path.unlink()
    return tuple(older[n_kept - 1 :])


def _name(now_ns: int) -> str:
    moment = datetime.fromtimestamp(s_from_ns(now_ns), UTC)
    return f"padwatch-{moment:%Y%m%dT%H%M%SZ}.sqlite3"
