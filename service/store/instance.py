"""One service for each database: a second one would be let in by SQLite without a word."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import structlog

from service.store.file_system import FileSystem, file_system_of
from service.store.port import StoreError
from service.store.usable import why_unusable

log = structlog.get_logger()

SUFFIX = ".lock"
_PID_BYTES = 20


class AlreadyRunningError(StoreError):
    """Another service works with the database; the message says which process it is."""


def lock_path(database: Path) -> Path:
    """The file whose lock a service holds while it works with a database."""
    return database.with_name(database.name + SUFFIX)


@contextmanager
def only_one(database: Path, look: Callable[[Path], FileSystem] = file_system_of) -> Iterator[None]:
    """Be the only service that works with a database.

    The lock ends with the process, however that ends; the file stays and means nothing by itself.

    Parameters
    ----------
    look
        Says what a folder is on.

    Raises
    ------
    AlreadyRunningError
        If another process is.
    StoreError
        If the folder cannot be written to, or is on a network file system.
    """
    path = lock_path(database)
    _require_local(database.parent, look(database.parent))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise StoreError(why_unusable(database) or f"{path}: {error.strerror}") from error
    try:
        _take(descriptor, database)
        yield
    finally:
        os.close(descriptor)


def _require_local(folder: Path, found: FileSystem) -> None:
    """Refuse a folder whose locks and syncs are those of another machine."""
    if found.is_remote:
        raise StoreError(
            f"{folder} is on a network file system ({found.kind}), where two services may write at"
            " once and what is acknowledged may be lost: choose a data folder on a local disk"
        )
    if found.warning:
        log.warning("the data folder may forget", folder=str(folder), why=found.warning)


def _take(descriptor: int, database: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(descriptor, _PID_BYTES, 0).decode("ascii", "replace").strip()
        raise AlreadyRunningError(
            f"another padwatch (process {holder or 'unknown'}) works with {database}:"
            " stop it, or choose another data folder"
        ) from None
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
