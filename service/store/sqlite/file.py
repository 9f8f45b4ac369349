"""File of a SQLite database: identity, truncation, error classification, and lock files."""

import os
import re
import resource
import sqlite3
from pathlib import Path

from service.store.holds import take_lock
from service.store.port import StoreError

LOGS = ("-wal", "-shm")

Identity = tuple[int, int]
"""Device and inode number of a file."""


class OpenedFile:
    """Identity of the database file that was opened."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._opened: Identity | None = None

    def remember(self) -> None:
        """Record the identity of the file that is at the path now."""
        self._opened = _identity(self._path)

    def require(self) -> None:
        """Check that the opened file is still at the path; no check before `remember`.

        Raises `StoreError` if the file was removed or replaced.
        """
        if self._opened is None:
            return
        found = _identity(self._path)
        if found is None:
            raise StoreError(
                f"{self._path}: the database file was removed while padwatch runs; restore it, or"
                " restart padwatch, which creates a new one"
            )
        if found != self._opened:
            raise StoreError(
                f"{self._path}: the database file was replaced while padwatch runs; restore it,"
                " or restart padwatch to use the new one"
            )

    def keep_logs_apart(self) -> None:
        """Rename the WAL files of a database file that was replaced, after closing the connections.

        At the next start SQLite would apply these WAL files to the new database and damage it.
        """
        if self._opened is None or self._opened == _identity(self._path):
            return
        for suffix in LOGS:
            log = self._path.with_name(self._path.name + suffix)
            if log.exists():
                log.rename(log.with_name(f"{self._path.name}.replaced-{self._opened[1]}{suffix}"))


def _identity(path: Path) -> Identity | None:
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_PAGE_BYTES_AT = slice(16, 18)
_LARGEST_PAGE = 65_536
"""Maximum page size in bytes, which the file header stores as 1."""


def truncation_of(path: Path) -> str | None:
    """Return a message if a database file is truncated; None if its length is plausible.

    The length is not checked if a WAL file exists, since the last page may be only in the WAL file.
    """
    log = path.with_name(path.name + "-wal")
    if not path.is_file() or (log.exists() and log.stat().st_size):
        return None
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    size = path.stat().st_size
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        return None  # a new file, or another format, for which SQLite raises an error
    written = int.from_bytes(header[_PAGE_BYTES_AT], "big")
    page_bytes = _LARGEST_PAGE if written == 1 else written
    if page_bytes == 0 or size % page_bytes == 0:
        return None
    return f"the file is truncated: {size} bytes are not a multiple of the page size, {page_bytes}"


IOERR = 10
"""Primary result code of read, write and sync errors (``SQLITE_IOERR``)."""

UNREADABLE = frozenset({IOERR, 11, 26})
"""Result codes of unreadable data: `IOERR`, ``SQLITE_CORRUPT`` and ``SQLITE_NOTADB``."""

OF_THE_ROW = frozenset({11, 18, 19, 20})
"""Primary result codes of errors caused by one row or its page (``SQLITE_CORRUPT``,
``SQLITE_TOOBIG``, ``SQLITE_CONSTRAINT``, ``SQLITE_MISMATCH``)."""

BY_TRIGGER = 1811
"""Extended result code of an error raised by a trigger, which no insertion of padwatch causes."""

PAGE_ROOM = 65_536
"""Distance from the file size limit, bytes, below which a transaction may not fit."""


def leaves_in_doubt(error: BaseException) -> bool:
    """Return whether the state of the last transaction on the disk is unknown after an error.

    The state is known if the disk is full, since SQLite has rolled the transaction back.
    """
    code = getattr(error, "sqlite_errorcode", None)
    return code is not None and code & 0xFF == IOERR


def is_of_the_row(error: BaseException) -> bool:
    """Return whether one row caused the error, so that all other rows can be written."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:  # raised by Python: an integer above 64 bits, or invalid text
        return isinstance(error, OverflowError | UnicodeEncodeError)
    return code & 0xFF in OF_THE_ROW and code != BY_TRIGGER


def is_of_the_data(error: BaseException | None) -> bool:
    """Return whether the error is permanent because stored data are unreadable."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:  # raised by Python: invalid text
        return isinstance(error, UnicodeError | sqlite3.OperationalError)
    return code & 0xFF in UNREADABLE


def error_message(path: Path, error: BaseException) -> str:
    """Return the message of a database error, with advice if the file size limit is reached."""
    if not leaves_in_doubt(error):
        return f"{path}: {error}"
    limit = _limit_reached(path)
    if limit is not None:
        return (
            f"{path}: the limit of file sizes, {limit} bytes, is reached: raise it"
            " (ulimit -f, LimitFSIZE= in the unit)"
        )
    return f"{path}: {error} ({getattr(error, 'sqlite_errorname', 'SQLITE_IOERR')})"


def _limit_reached(path: Path) -> int | None:
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    files = (path, path.with_name(path.name + "-wal"))
    is_reached = any(f.exists() and f.stat().st_size + PAGE_ROOM > limit for f in files)
    return limit if is_reached else None


class FileHold:
    """Exclusive lock on a name, implemented by a lock file; the lock ends with the process.

    Parameters
    ----------
    path
        Path of the lock file, which is not deleted when the lock is released.
    name
        Name of the lock, for error messages.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        self._descriptor: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether this process holds the lock, which it cannot lose."""
        return self._descriptor is not None

    def __enter__(self) -> "FileHold":
        try:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StoreError(f"{self._path} cannot be locked: {error.strerror}") from error
        if (holder := take_lock(descriptor)) is not None:
            os.close(descriptor)
            raise StoreError(
                f"{self._name} is held by another padwatch (process {holder}): stop it first"
            )
        self._descriptor = descriptor
        return self

    def __exit__(self, *_: object) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def held(database: Path, name: str) -> FileHold:
    """Return a lock on a name, a lock file beside the database.

    Entering the lock raises `StoreError` if another process holds it.
    """
    safe = re.sub(r"[^A-Za-z0-9_-]", lambda found: f"%{ord(found[0]):x}", name)
    return FileHold(database.with_name(f"{database.name}.{safe}.lock"), name)
