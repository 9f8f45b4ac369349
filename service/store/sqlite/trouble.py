"""What an error of the disk means, and what to do about it."""

import resource
import sqlite3
from pathlib import Path

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
