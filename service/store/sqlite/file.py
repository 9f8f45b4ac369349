"""File of a SQLite database: its identity, its errors, and locks beside it."""

import fcntl
import os
import re
import resource
import sqlite3
from pathlib import Path
from types import TracebackType

from service.store.port import StoreError

LOGS = ("-wal", "-shm")

Identity = tuple[int, int]
"""Device and inode."""


class OpenedFile:
    """The database file as it was when it was opened.

    Parameters
    ----------
    path
        Its name.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._opened: Identity | None = None

    def remember(self) -> None:
        """Take the file that has the name now for the one that is open."""
        self._opened = _identity(self._path)

    def require(self) -> None:
        """Check that the open file still has its name; before `remember` nothing is checked.

        Raises
        ------
        StoreError
            If the file was removed, or another one has its name.
        """
        if self._opened is None:
            return
        found = _identity(self._path)
        if found is None:
            raise StoreError(
                f"{self._path}: the database file was removed while padwatch runs; put it back, or"
                " restart padwatch, which makes a new one"
            )
        if found != self._opened:
            raise StoreError(
                f"{self._path}: the database file was replaced while padwatch runs; put it back,"
                " or restart padwatch to go on with the new one"
            )

    def keep_logs_apart(self) -> None:
        """After closing: rename logs that are not of the file that has the name now.

        SQLite would take them for that file's at the next start, and damage it.
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
"""Written as 1."""


def why_cut(path: Path) -> str | None:
    """Why a database file cannot be whole; None if its length says nothing against it.

    With a log beside it the file may end anywhere: the log holds the page that was being written.
    """
    log = path.with_name(path.name + "-wal")
    if not path.is_file() or (log.exists() and log.stat().st_size):
        return None
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    size = path.stat().st_size
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        return None  # new, or nothing of SQLite's, which says so itself
    written = int.from_bytes(header[_PAGE_BYTES_AT], "big")
    page_bytes = _LARGEST_PAGE if written == 1 else written
    if page_bytes == 0 or size % page_bytes == 0:
        return None
    return f"{size} bytes are no whole pages of {page_bytes}: the end of the file is missing"


IOERR = 10
"""Primary code of all errors of reading, writing and syncing (``SQLITE_IOERR``)."""

UNREADABLE = frozenset({IOERR, 11, 26})
"""And of pages that are no pages of a database (``SQLITE_CORRUPT``, ``SQLITE_NOTADB``)."""

OF_THE_ROW = frozenset({11, 18, 19, 20})
"""Primary codes of what a row or its page is to blame for (``SQLITE_CORRUPT``, ``SQLITE_TOOBIG``,
``SQLITE_CONSTRAINT``, ``SQLITE_MISMATCH``)."""

BY_TRIGGER = 1811
"""Extended code of a refusal by a trigger, which no insertion of padwatch's meets."""

PAGE_ROOM = 65_536
"""So near its limit a file cannot grow by a transaction any more."""


def leaves_in_doubt(error: BaseException) -> bool:
    """Whether nobody knows what of the last transaction is on the disk.

    A disk that is full is not among them: SQLite has undone the transaction then.
    """
    code = getattr(error, "sqlite_errorcode", None)
    return code is not None and code & 0xFF == IOERR


def is_of_the_row(error: BaseException) -> bool:
    """Whether one row is to blame, so that others of its transaction can be written without it."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:  # of Python's own: a number beyond 64 bits, text that is none
        return isinstance(error, OverflowError | UnicodeEncodeError)
    return code & 0xFF in OF_THE_ROW and code != BY_TRIGGER


def is_of_the_data(error: BaseException | None) -> bool:
    """Whether what is stored cannot be read, and reading it again will not help."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:  # of Python's own: text that is none
        return isinstance(error, UnicodeError | sqlite3.OperationalError)
    return code & 0xFF in UNREADABLE


def told(path: Path, error: BaseException) -> str:
    """One sentence for whoever has to put it right."""
    if not leaves_in_doubt(error):
        return f"{path}: {error}"
    limit = _limit_reached(path)
    if limit is not None:
        return (
            f"{path}: no file may be larger than {limit} bytes here: raise the limit of file sizes"
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


_PID_BYTES = 20


class FileHold:
    """A name held by the lock of a file; it ends with the process, however that ends.

    Parameters
    ----------
    path
        The file; it stays, and means nothing by itself.
    name
        For the message.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        self._descriptor: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether it is; nobody can take the lock of a file away."""
        return self._descriptor is not None

    def __enter__(self) -> "FileHold":
        try:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StoreError(f"{self._path}: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, _PID_BYTES, 0).decode("ascii", "replace").strip()
            os.close(descriptor)
            raise StoreError(
                f"{self._name} is held by another padwatch (process {holder or 'unknown'}):"
                " stop it first"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self._descriptor = descriptor
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def held(database: Path, name: str) -> FileHold:
    """Build the hold of a name beside a database file."""
    safe = re.sub(r"[^A-Za-z0-9_-]", lambda found: f"%{ord(found[0]):x}", name)
    return FileHold(database.with_name(f"{database.name}.{safe}.lock"), name)
