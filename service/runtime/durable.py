"""Files that are on the disk, not only on their way there."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.store.backup.check import BackupError

PRIVATE = 0o600


def create_private(path: Path) -> None:
    """Make an empty file that only its owner may read: what is copied holds accounts."""
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, PRIVATE))


def put_in_place(aside: Path, path: Path) -> None:
    """Give a finished file its name, in one step, and have both on the disk."""
    _sync(aside)
    aside.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk."""
    _sync(folder)


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


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
