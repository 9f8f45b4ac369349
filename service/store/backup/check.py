"""What a database file holds, and whether it is whole."""

import fcntl
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from service.settings.storage import Origin
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
