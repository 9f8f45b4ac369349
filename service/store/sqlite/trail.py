"""The audit trail of a database file, without opening the store: nothing is changed or upgraded."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

from service.store.access.audit_verification import Verdict, head_path
from service.store.audit import Trail
from service.store.port import StoreError
from service.store.sqlite.readers import BUSY_TIMEOUT_S


def file_trail(database: Path) -> Trail:
    """Trail of a database file, which is opened as it is read."""
    return Trail(partial(_opened, database), head_path(database))


def verify_trail(database: Path) -> Verdict:
    """Walk the trail of a database file.

    Raises
    ------
    StoreError
        If there is none, or it cannot be read.
    """
    return file_trail(database).verify()


@contextmanager
def _opened(database: Path) -> Iterator[sqlite3.Connection]:
    if not database.exists():
        raise StoreError(f"{database.absolute()}: there is no database")
    uri = f"{database.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as reader:
            reader.text_factory = _exact
            yield reader
    except (OSError, sqlite3.Error, UnicodeDecodeError) as error:
        raise StoreError(f"{database}: {error}") from error


def _exact(text: bytes) -> str:
    """Text that tells every byte from every other, also where it is not UTF-8."""
    return text.decode("utf-8", "surrogateescape")
