"""`restore`: a verified copy takes the database's place, while nobody uses that."""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from core.units import s_from_ns
from service.runtime.files import create_private, put_in_place, sync_folder
from service.store.backup.check import BackupError, Content, checked
from service.store.highwater.adopting import adopt_copy

LOGS = ("-wal", "-shm")
"""What SQLite keeps beside a database that is open, or was when its process died."""


@dataclass(frozen=True)
class Restored:
    """What has been put in place.

    Parameters
    ----------
    before
        Where the database that was there is now; None if there was none.
    """

    database: Path
    before: Path | None
    content: Content


def restore(copy: Path, database: Path, now_ns: int) -> Restored:
    """Put a copy in a database's place, in one step; what was there is kept beside it.

    Raises
    ------
    BackupError
        If the copy is not whole or of a newer schema, or the database is in use; then nothing has
        changed.
    """
    content = checked(copy)
    if database.exists() and copy.samefile(database):
        raise BackupError(f"{copy} is the database itself")
    try:
        database.parent.mkdir(parents=True, exist_ok=True)
        return Restored(database, _replace(copy, database, now_ns), content)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{database}: restoring {copy} failed: {error}") from error


def _replace(copy: Path, database: Path, now_ns: int) -> Path | None:
    aside = database.with_name(f".{database.name}.restoring")
    aside.unlink(missing_ok=True)
    with _unused(database):
        create_private(aside)
        try:
            shutil.copyfile(copy, aside)
            checked(aside)
            before = _keep(database, now_ns)
            put_in_place(aside, database)
            adopt_copy(database)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    return before


def _keep(database: Path, now_ns: int) -> Path | None:
    """Give what is there a second name; logs go with it, or they would be taken for the copy's."""
    if not database.exists():
        return None
    moment = datetime.fromtimestamp(s_from_ns(now_ns), UTC)
    before = database.with_name(f"{database.name}.before-{moment:%Y%m%dT%H%M%SZ}")
    before.hardlink_to(database)
    for log in LOGS:
        beside = database.with_name(database.name + log)
        if beside.exists():
            beside.rename(before.with_name(before.name + log))
    sync_folder(database.parent)
    return before


@contextmanager
def _unused(database: Path) -> Iterator[None]:
    """Hold a database so that nobody else has it open; one too damaged to be held is let be."""
    if not database.exists():
        yield
        return
    with closing(sqlite3.connect(database, timeout=0.0, isolation_level=None)) as connection:
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            connection.execute("COMMIT")
            connection.execute("PRAGMA journal_mode = DELETE")  # all that the log holds is in now
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise BackupError(
                    f"{database} is in use; stop padwatch before restoring"
                ) from error
            raise
        except sqlite3.DatabaseError:
            pass  # damaged: this is why a copy is put in its place
        yield
