"""Copies of the database: made while the service runs, verified, and put back."""

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
from service.store.highwater.commits import adopt_copy
from service.store.schema import MIGRATIONS
from service.store.sqlite.migrating import APPLICATION_IDS

MAX_FINDINGS = 5
"""Of damage, in a message."""

EVERY_FINDING = 2**31 - 1

NULL_FINDING = "NULL value in "


class BackupError(Exception):
    """A copy cannot be made, is not whole, or cannot be put back; the message says why."""


@dataclass(frozen=True)
class Content:
    """What a database holds.

    Parameters
    ----------
    schema
        Number of the newest migration it has seen.
    n_rows
        Of each table.
    """

    schema: int
    n_rows: Mapping[str, int]


def content_of(connection: sqlite3.Connection) -> Content:
    """Count what a database holds, as of the connection's transaction."""
    names = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT GLOB 'sqlite_*'"
    ).fetchall()
    n_rows = {
        str(name): int(connection.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0])  # noqa: S608
        for (name,) in names
    }
    return Content(_number(connection, "user_version"), n_rows)


def checked(path: Path) -> Content:
    """Read a copy from end to end.

    Raises
    ------
    BackupError
        If it is damaged, not a live plant's database of padwatch, or of a newer schema.
    """
    if not path.is_file():
        raise BackupError(f"{path}: there is no such file")
    try:
        # nobody writes to a copy: no journal of it is looked for or left behind
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as connection:
            _require_ours(connection, path)
            _require_whole(connection, path)
            return content_of(connection)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise BackupError(f"{path}: {error}") from error


def _require_ours(connection: sqlite3.Connection, path: Path) -> None:
    if _number(connection, "application_id") != APPLICATION_IDS[Origin.LIVE]:
        raise BackupError(f"{path} is not a database of a live plant by padwatch")
    schema = _number(connection, "user_version")
    if schema > len(MIGRATIONS):
        raise BackupError(
            f"{path} has schema {schema}, this padwatch knows up to {len(MIGRATIONS)};"
            " use the padwatch that wrote it, or a newer one"
        )


def _require_whole(connection: sqlite3.Connection, path: Path) -> None:
    damage = list(islice(_damage(connection), MAX_FINDINGS))
    if damage:
        raise BackupError(f"{path} is damaged: " + "; ".join(damage))
    loose = connection.execute("PRAGMA foreign_key_check").fetchone()
    if loose is not None:
        raise BackupError(f"{path} is damaged: rows of {loose[0]} belong to nothing")


def _damage(connection: sqlite3.Connection) -> Iterator[str]:
    """What is wrong; SQLite before 3.41 finds nulls that are none in tables WITHOUT ROWID."""
    said_null = set()
    for (finding,) in connection.execute(f"PRAGMA integrity_check({EVERY_FINDING})"):
        if finding.startswith(NULL_FINDING):
            said_null.add(finding)
        elif finding != "ok":
            yield finding
    for finding in sorted(said_null):
        table, _, column = finding.removeprefix(NULL_FINDING).partition(".")
        looked = f'SELECT 1 FROM "{table}" WHERE typeof("{column}") = \'null\' LIMIT 1'  # noqa: S608
        if connection.execute(looked).fetchone() is not None:
            yield finding


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    return int(connection.execute(f"PRAGMA {pragma}").fetchone()[0])


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep other backups out of a folder.

    Raises
    ------
    BackupError
        If another one is at work there.
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


@dataclass(frozen=True)
class AccessBefore:
    """Who and what could come in by the database that a copy takes the place of.

    Parameters
    ----------
    accounts
        Names of its accounts.
    revoked
        Ids of the keys that were revoked in it.
    """

    accounts: frozenset[str]
    revoked: frozenset[str]


@dataclass(frozen=True)
class AccessAfter:
    """Who and what can come in by the copy.

    Parameters
    ----------
    accounts, keys
        Names of accounts, and names of valid keys with their ids.
    returned
        Accounts that the database before did not have: perhaps they were removed.
    revoked
        Ids of keys that were revoked before and have been revoked again.
    """

    accounts: tuple[str, ...]
    keys: tuple[str, ...]
    returned: tuple[str, ...]
    revoked: tuple[str, ...]


def access_before(database: Path) -> AccessBefore | None:
    """Read it; None if there is no database, or none that can be read."""
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


def take_back(access: AccessStore, before: AccessBefore | None, now_ns: int) -> AccessAfter:
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
