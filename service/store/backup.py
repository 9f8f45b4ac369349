"""Backups of a SQLite database: online backup, verification, and restoration."""

import fcntl
import os
import re
import shutil
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

from core.units import s_from_ns
from service.runtime.files import create_private, put_in_place, sync_folder
from service.settings.storage import Origin
from service.store.access.identities import KeyState
from service.store.access.tables import AccessStore
from service.store.highwater.commits import adopt_restored
from service.store.schema import MIGRATIONS
from service.store.sqlite.checking import structure_findings
from service.store.sqlite.migrating import application_id_of

MAX_FINDINGS = 5
"""Maximum number of defects listed in an error message."""


class BackupError(Exception):
    """Error raised if a backup cannot be made or restored, or is damaged."""


@dataclass(frozen=True)
class Content:
    """Summary of the content of a database: schema number, and number of rows by table name."""

    schema: int
    n_rows: Mapping[str, int]


def _content_of(connection: sqlite3.Connection) -> Content:
    """Return the schema number and row counts of a database, within the current transaction."""
    names = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT GLOB 'sqlite_*'"
    ).fetchall()
    n_rows = {
        str(name): int(connection.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0])  # noqa: S608
        for (name,) in names
    }
    return Content(_number(connection, "user_version"), n_rows)


def checked(path: Path, origin: Origin | None = Origin.LIVE) -> Content:
    """Verify a backup completely and return its schema number and row counts.

    Parameters
    ----------
    origin
        Origin of the data; None for a backup of the access file.

    Raises
    ------
    BackupError
        If the backup is missing or damaged, has another origin, or has a newer schema.
    """
    if not path.is_file():
        raise BackupError(f"{path}: the backup does not exist; check the path")
    try:
        # immutable: no journal is read or created
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as connection:
            _require_ours(connection, path, origin)
            _require_whole(connection, path)
            return _content_of(connection)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise BackupError(f"{path} cannot be read: {error}; use another backup") from error


def _require_ours(connection: sqlite3.Connection, path: Path, origin: Origin | None) -> None:
    if _number(connection, "application_id") != application_id_of(origin):
        what = "padwatch database of a live plant" if origin else "access database of padwatch"
        raise BackupError(f"{path} is not the {what}; choose another file")
    schema = _number(connection, "user_version")
    if schema > len(MIGRATIONS):
        raise BackupError(
            f"{path} has schema version {schema}; this padwatch supports up to {len(MIGRATIONS)};"
            " use the padwatch that wrote it, or a newer one"
        )


def _require_whole(connection: sqlite3.Connection, path: Path) -> None:
    damage = list(islice(structure_findings(connection), MAX_FINDINGS))
    if damage:
        raise BackupError(f"{path} is damaged, use another backup: " + "; ".join(damage))
    loose = connection.execute("PRAGMA foreign_key_check").fetchone()
    if loose is not None:
        raise BackupError(
            f"{path} is damaged, use another backup: rows of {loose[0]} refer to missing rows"
        )


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    return int(connection.execute(f"PRAGMA {pragma}").fetchone()[0])


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Return a context manager that locks a folder against other backups within its block.

    Raises `BackupError` if another backup is being written to the folder.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise BackupError(f"{folder}: another backup is being written; retry later") from error
    finally:
        os.close(descriptor)


BUSY_TIMEOUT_S = 30.0

NAME = re.compile(r"(?P<stem>[a-z]+)-\d{8}T\d{6}Z\.sqlite3")


@dataclass(frozen=True)
class Backup:
    """Verified backup in the file `path`, of `n_bytes` bytes.

    `removed` are the paths of older backups that were removed after it was verified.
    """

    path: Path
    n_bytes: int
    content: Content
    removed: tuple[Path, ...]


def back_up(
    database: Path, folder: Path, now_ns: int, n_kept: int, origin: Origin | None = Origin.LIVE
) -> Backup:
    """Back up a database by SQLite's online backup, verify the backup, and remove old backups.

    Old backups are removed only after the new backup, named after `now_ns`, is verified.

    Parameters
    ----------
    folder
        Folder of the backups; created if missing.
    n_kept
        Number of backups to keep, at least 1.
    origin
        Origin of the data; None for the access file.

    Raises
    ------
    BackupError
        If the backup, its verification or the removal of older backups fails.
    """
    if not database.is_file():
        raise BackupError(f"{database}: the database does not exist; check the path")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone_in(folder):
            return _back_up(database, folder, now_ns, n_kept, origin)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{folder}: the backup of {database} failed: {error}") from error


def _back_up(
    database: Path, folder: Path, now_ns: int, n_kept: int, origin: Origin | None
) -> Backup:
    moment = datetime.fromtimestamp(s_from_ns(now_ns), UTC)
    path = folder / f"{database.stem}-{moment:%Y%m%dT%H%M%SZ}.sqlite3"
    aside = folder / f".{path.name}.part"
    for leftover in folder.glob(f".{database.stem}-*.sqlite3.part*"):
        leftover.unlink()
    create_private(aside)
    try:
        expected = _copy(database, aside)
        found = checked(aside, origin)
        if found != expected:
            raise BackupError(
                f"{aside} differs from {database} in its schema or numbers of rows; check the disk"
            )
        put_in_place(aside, path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
    return Backup(path, path.stat().st_size, found, _make_room(path, database.stem, n_kept))


def _copy(database: Path, aside: Path) -> Content:
    uri = f"{database.absolute().as_uri()}?mode=ro"
    with (
        closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as source,
        closing(sqlite3.connect(aside, isolation_level=None)) as target,
    ):
        source.execute("BEGIN")  # rows are counted and copied in the same state
        content = _content_of(source)
        source.backup(target)
        target.execute("PRAGMA journal_mode = DELETE")  # one file, without a WAL file
    return content


def _make_room(newest: Path, stem: str, n_kept: int) -> tuple[Path, ...]:
    """Remove the oldest backups beyond the number to keep, but never the newest."""
    named = ((path, NAME.fullmatch(path.name)) for path in newest.parent.iterdir())
    others = (path for path, name in named if name and name["stem"] == stem)
    older = sorted((path for path in others if path != newest), reverse=True)
    for path in older[n_kept - 1 :]:
        path.unlink()
    return tuple(older[n_kept - 1 :])


def backup_beside(copy: Path, stem: str) -> Path | None:
    """Return the path of the backup of another database that was made at the same time as `copy`.

    `stem` is the file name of the other database without its suffix. None if the backup does not
    exist.
    """
    name = NAME.fullmatch(copy.name)
    if name is None:
        return None
    beside = copy.with_name(stem + copy.name.removeprefix(name["stem"]))
    return beside if beside.is_file() else None


LOGS = ("-wal", "-shm")
"""Suffixes of the WAL and shared-memory files, which SQLite keeps beside an open database and
leaves after a crash."""


@dataclass(frozen=True)
class Restored:
    """Result of restoring a backup.

    Parameters
    ----------
    before
        New path of the previous database; None if no database existed.
    """

    database: Path
    before: Path | None
    content: Content


def restore(
    copy: Path, database: Path, now_ns: int, origin: Origin | None = Origin.LIVE
) -> Restored:
    """Replace a database atomically by a backup; the previous database is kept beside it.

    Parameters
    ----------
    origin
        Origin of the data; None for the access file.

    Raises
    ------
    BackupError
        If the backup is damaged or has a newer schema, if the database is in use, or if a file
        cannot be written.
    """
    content = checked(copy, origin)
    if database.exists() and copy.samefile(database):
        raise BackupError(f"{copy} is the database itself; choose a backup")
    try:
        database.parent.mkdir(parents=True, exist_ok=True)
        return Restored(database, _replace(copy, database, now_ns, origin), content)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{database}: restoring {copy} failed: {error}") from error


def _replace(copy: Path, database: Path, now_ns: int, origin: Origin | None) -> Path | None:
    aside = database.with_name(f".{database.name}.restoring")
    aside.unlink(missing_ok=True)
    with _unused(database):
        create_private(aside)
        try:
            shutil.copyfile(copy, aside)
            checked(aside, origin)
            before = _keep(database, now_ns)
            put_in_place(aside, database)
            adopt_restored(database)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    return before


def _keep(database: Path, now_ns: int) -> Path | None:
    """Hard-link the existing database to a second name; move its WAL files to that name."""
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
    """Lock a database exclusively; skip the lock if the database is too damaged."""
    if not database.exists():
        yield
        return
    with closing(sqlite3.connect(database, timeout=0.0, isolation_level=None)) as connection:
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            connection.execute("COMMIT")
            connection.execute("PRAGMA journal_mode = DELETE")  # moves the WAL into the database
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise BackupError(
                    f"{database} is in use; stop padwatch before restoring"
                ) from error
            raise
        except sqlite3.DatabaseError:
            pass  # damaged, hence the restoration
        yield


@dataclass(frozen=True)
class AccessBefore:
    """Account names and identifiers of revoked API keys in the database that a backup replaces."""

    accounts: frozenset[str]
    revoked: frozenset[str]


@dataclass(frozen=True)
class AccessAfter:
    """Accounts and keys of a restored database.

    Parameters
    ----------
    accounts, keys
        Names of the accounts; names and identifiers of the valid API keys.
    returned
        Names of the accounts that the previous database did not have, such as accounts that were
        removed after the backup.
    revoked
        Identifiers of the keys that were revoked again after the restoration.
    """

    accounts: tuple[str, ...]
    keys: tuple[str, ...]
    returned: tuple[str, ...]
    revoked: tuple[str, ...]


def access_before(database: Path) -> AccessBefore | None:
    """Return the accounts and revoked keys of a database; None if it is missing or unreadable."""
    uri = f"{database.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as reader:
            accounts = reader.execute("SELECT name FROM account").fetchall()
            revoked = reader.execute("SELECT id FROM api_key WHERE revoked_ns IS NOT NULL")
            return AccessBefore(
                frozenset(name for (name,) in accounts), frozenset(id_ for (id_,) in revoked)
            )
    except (sqlite3.Error, UnicodeDecodeError):
        return None


def revoke_again(access: AccessStore, before: AccessBefore | None, now_ns: int) -> AccessAfter:
    """End all sessions of a restored database, and revoke the keys that `before` lists as revoked.

    `before` is the content of the replaced database; None if it was missing or unreadable, in
    which case no key is revoked.

    Raises
    ------
    StoreError
        If the restored database cannot be written.
    """
    access.sessions.end_all()
    ids = before.revoked if before else frozenset()
    revoked = [key.id for key in access.keys.all() if key.id in ids and key.revoked_ns is None]
    for id_ in revoked:
        access.keys.revoke(id_, now_ns)
    accounts = [account.name for account in access.accounts.all()]
    valid = [key for key in access.keys.all() if key.state(now_ns) is KeyState.VALID]
    return AccessAfter(
        accounts=tuple(accounts),
        keys=tuple(f"{key.name} ({key.id})" for key in valid),
        returned=tuple(name for name in accounts if before and name not in before.accounts),
        revoked=tuple(revoked),
    )
