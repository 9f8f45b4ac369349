"""Store in a SQLite database file."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from threading import Lock

from service.settings.storage import Origin, SpectraSettings
from service.store.access.audit_verification import head_path
from service.store.access.tables import AccessStore
from service.store.audit import AuditChain, Trail, begin_head, closed_after_error
from service.store.integrity import Integrity
from service.store.outbox import Address, no_recipients
from service.store.port import StoreError
from service.store.retention import RetentionStore
from service.store.sqlite.checking import Scrubber
from service.store.sqlite.connections import BUSY_TIMEOUT_S
from service.store.sqlite.database import SqliteDatabase, SqliteReading
from service.store.store import Store


class SqliteStore(Store):
    """Store in a SQLite database file; used by several threads, one writer at a time.

    Parameters
    ----------
    path
        Path of the file; the file and its folder are created if missing.
    origin
        Origin of the stored data; a file with data of another origin is rejected.
    address
        Function that returns the outbox messages about an alarm event.
    spectra
        Limits of stored spectra; None for the defaults of `SpectraSettings`.

    Raises
    ------
    StoreError
        If the file cannot be opened, is damaged, belongs to another program, or has a newer schema
        than this program.
    """

    def __init__(
        self,
        path: Path,
        origin: Origin = Origin.LIVE,
        address: Address = no_recipients,
        spectra: SpectraSettings | None = None,
    ) -> None:
        database = self._file = SqliteDatabase(path, origin)
        with _begun_head(database, path):
            super().__init__(database, head_path(path), address, spectra)
            self.retention = RetentionStore(self._writing, self._reader, database.give_back)
            scrubber = Scrubber(database, database.seals, database.damage)
            self.integrity = _integrity(database, self._chain, scrubber.check_some)

    @property
    def _writer(self) -> sqlite3.Connection:
        """Current write connection; replaced after a disk error."""
        return self._file.writer.connection

    @property
    def _lock(self) -> Lock:
        return self._file.writer.lock


class SqliteReader(Store):
    """Store in a SQLite file that another process writes; its methods that write raise an error.

    Parameters
    ----------
    path
        Path of the file, which the other process has opened before.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        database = SqliteReading(path)
        super().__init__(database, head_path(path), is_read_only=True)
        self.integrity = Integrity(
            self._chain, damage=database.damage, require_file=database.file.require
        )


def open_access_file(path: Path) -> AccessStore:
    """Open the file of accounts, sessions and keys; the file is created if missing.

    Raises
    ------
    StoreError
        If the file cannot be opened, is damaged, belongs to another program, or has a newer schema
        than this program.
    """
    database = SqliteDatabase(path, None)
    with _begun_head(database, path):
        chain = AuditChain(head_path(path), database)
        return AccessStore(database, chain, _integrity(database, chain))


@contextmanager
def _begun_head(database: SqliteDatabase, path: Path) -> Iterator[None]:
    """Create the head file of a new database; close the database after an error in the block."""
    with closed_after_error(database, head_path(path)):
        if not database.had_trail:
            begin_head(head_path(path))
        yield


def _integrity(
    database: SqliteDatabase, chain: AuditChain, check_some: Callable[[], bool] = lambda: True
) -> Integrity:
    return Integrity(chain, database.marks, database.damage, check_some, database.file.require)


def file_trail(database: Path) -> Trail:
    """Return the audit trail of a database file; each read opens the file read-only."""
    return Trail(partial(_opened, database), head_path(database))


@contextmanager
def _opened(database: Path) -> Iterator[sqlite3.Connection]:
    if not database.exists():
        raise StoreError(f"{database.absolute()}: the database does not exist; check data_folder")
    uri = f"{database.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as reader:
            reader.text_factory = _exact
            yield reader
    except (OSError, sqlite3.Error, UnicodeDecodeError) as error:
        raise StoreError(f"{database}: {error}") from error


def _exact(text: bytes) -> str:
    """Decode text without loss, also if it is not valid UTF-8."""
    return text.decode("utf-8", "surrogateescape")
