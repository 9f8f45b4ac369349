"""Backups of a SQLite database: made while the service runs, verified, and restored."""

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
from service.store.sqlite.migrating import APPLICATION_IDS

MAX_FINDINGS = 5
"""Maximum number of defects in a message."""


class BackupError(Exception):
    """A copy cannot be made, is damaged, or cannot be restored; the message says why."""


@dataclass(frozen=True)
class Content:
    """Content of a database.

    Parameters
    ----------
    schema
        Number of its schema.
    n_rows
        Number of rows by table.
    """

    schema: int
    n_rows: Mapping[str, int]


def content_of(connection: sqlite3.Connection) -> Content:
    """Return the content of a database, as of the connection's transaction."""
    names = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT GLOB 'sqlite_*'"
    ).fetchall()
    n_rows = {
        str(name): int(connection.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0])  # noqa: S608
        for (name,) in names
    }
    return Content(_number(connection, "user_version"), n_rows)


def checked(path: Path) -> Content:
    """Verify a copy completely and return its content.

    Raises
    ------
    BackupError
        If it is damaged, not the database of a live plant, or of a newer schema.
    """
    if not path.is_file():
        raise BackupError(f"{path}: there is no such file")
    try:
        # immutable: no journal is read or created
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as connection:
            _require_ours(connection, path)
            _require_whole(connection, path)
            return content_of(connection)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise BackupError(f"{path}: {error}") from error


def _require_ours(connection: sqlite3.Connection, path: Path) -> None:
    if _number(connection, "application_id") != APPLICATION_IDS[Origin.LIVE]:
        raise BackupError(f"{path} is not the padwatch database of a live plant")
    schema = _number(connection, "user_version")
    if schema > len(MIGRATIONS):
        raise BackupError(
            f"{path} has schema {schema}, this padwatch supports up to {len(MIGRATIONS)};"
            " use the padwatch that wrote it, or a newer one"
        )


def _require_whole(connection: sqlite3.Connection, path: Path) -> None:
    damage = list(islice(structure_findings(connection), MAX_FINDINGS))
    if damage:
        raise BackupError(f"{path} is damaged: " + "; ".join(damage))
    loose = connection.execute("PRAGMA foreign_key_check").fetchone()
    if loose is not None:
        raise BackupError(f"{path} is damaged: rows of {loose[0]} refer to missing rows")


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    return int(connection.execute(f"PRAGMA {pragma}").fetchone()[0])


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Exclude other backups from a folder.

    Raises
    ------
    BackupError
        If another backup is being written there.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise BackupError(f"{folder}: another backup is being written there") from error
    finally:
        os.close(descriptor)


BUSY_TIMEOUT_S = 30.0

NAME = re.compile(r"padwatch-\d{8}T\d{6}Z\.sqlite3")


@dataclass(frozen=True)
class Backup:
    """Verified copy.

    Parameters
    ----------
    removed
        Older copies that were removed.
    """

    path: Path
    n_bytes: int
    content: Content
    removed: tuple[Path, ...]


def back_up(database: Path, folder: Path, now_ns: int, n_kept: int) -> Backup:
    """Copy a database by SQLite's online backup, verify the copy, and remove the oldest ones.

    Older copies are removed only after the new one is verified and on the disk.

    Parameters
    ----------
    folder
        Folder of the copies; created if missing.
    n_kept
        Number of copies to keep, at least 1.

    Raises
    ------
    BackupError
        If there is no verified copy; the folder is then unchanged.
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
    """Copy one state of a database; return its content."""
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
    """Remove the oldest copies, but never the newest."""
    others = (path for path in newest.parent.iterdir() if NAME.fullmatch(path.name))
    older = sorted((path for path in others if path != newest), reverse=True)
    for path in older[n_kept - 1 :]:
        path.unlink()
    return tuple(older[n_kept - 1 :])


def _name(now_ns: int) -> str:
    moment = datetime.fromtimestamp(s_from_ns(now_ns), UTC)
    return f"padwatch-{moment:%Y%m%dT%H%M%SZ}.sqlite3"


LOGS = ("-wal", "-shm")
"""Suffixes of the files that SQLite keeps beside an open database, or leaves after a crash."""


@dataclass(frozen=True)
class Restored:
    """Result of restoring a copy.

    Parameters
    ----------
    before
        New path of the previous database; None if there was none.
    """

    database: Path
    before: Path | None
    content: Content


def restore(copy: Path, database: Path, now_ns: int) -> Restored:
    """Replace a database by a copy in one step; the previous database is kept beside it.

    Raises
    ------
    BackupError
        If the copy is damaged or of a newer schema, or the database is in use; then nothing has
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
            adopt_restored(database)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    return before


def _keep(database: Path, now_ns: int) -> Path | None:
    """Give the existing database a second name, and move its logs, which do not fit the copy."""
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
    """Lock a database against use; one that is too damaged to be locked is ignored."""
    if not database.exists():
        yield
        return
    with closing(sqlite3.connect(database, timeout=0.0, isolation_level=None)) as connection:
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            connection.execute("COMMIT")
            connection.execute("PRAGMA journal_mode = DELETE")  # moves the log into the database
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise BackupError(
                    f"{database} is in use; stop padwatch before restoring"
                ) from error
            raise
        except sqlite3.DatabaseError:
            pass  # damaged: the reason for restoring a copy
        yield


@dataclass(frozen=True)
class AccessBefore:
    """Access to the database that a copy replaces.

    Parameters
    ----------
    accounts
        Names of its accounts.
    revoked
        Identifiers of its revoked keys.
    """

    accounts: frozenset[str]
    revoked: frozenset[str]


@dataclass(frozen=True)
class AccessAfter:
    """Access to the copy.

    Parameters
    ----------
    accounts, keys
        Names of accounts; names and identifiers of valid keys.
    returned
        Accounts that the previous database did not have, perhaps because they were removed.
    revoked
        Identifiers of keys that were revoked again.
    """

    accounts: tuple[str, ...]
    keys: tuple[str, ...]
    returned: tuple[str, ...]
    revoked: tuple[str, ...]


def access_before(database: Path) -> AccessBefore | None:
    """Return the access to a database; None if there is none, or it is unreadable."""
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
    """End all sessions of a copy, and revoke the keys that were revoked since it was made.

    Raises
    ------
    StoreError
        If the copy cannot be written.
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
