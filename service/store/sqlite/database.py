"""SQLite database in WAL mode with synchronous=FULL, one writer and short read transactions."""

import sqlite3
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path

from acquisition.clock import SystemClock
from service.settings.storage import Origin
from service.store.database import Connection, Unreadable
from service.store.highwater.commits import CommitMarks
from service.store.highwater.mark import MarkFile, mark_path
from service.store.holds import why_unusable
from service.store.port import RefusedRowError, StoreError
from service.store.seals import DamageLog, Seals
from service.store.sqlite.connections import Readers, Writer, opened
from service.store.sqlite.file import (
    FileHold,
    OpenedFile,
    error_message,
    held,
    is_of_the_row,
    truncation_of,
)
from service.store.sqlite.migrating import migrate

PAGE_BYTES = 8192
"""Page size in bytes; a result row with all quantities would fill a page of 4096 bytes."""

EVER_HAD = "SELECT 1 FROM sqlite_sequence WHERE name = ?"
HAS_TRAIL = "SELECT 1 FROM sqlite_master WHERE name = 'audit'"


class SqliteReading:
    """SQLite database that another process writes; several threads of this process read it.

    Parameters
    ----------
    path
        Path of the file, which another process has created and migrated.

    Attributes
    ----------
    damage
        Log of the damaged and missing rows found since the start.
    file
        Identity of the opened file.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """

    kind = "sqlite"

    def __init__(self, path: Path) -> None:
        self._begin(path)
        if not path.exists():
            raise StoreError(
                f"{path}: the database does not exist; start padwatch, which creates it"
            )
        self.file.remember()
        uri = f"{path.absolute().as_uri()}?mode=ro"
        with self._store_errors(), closing(sqlite3.connect(uri, uri=True)) as reader:
            self.seals.load(reader)

    def _begin(self, path: Path) -> None:
        self._path = path
        self.damage = DamageLog()
        self.seals = Seals(self.damage)
        self.file = OpenedFile(path)
        self._readers = Readers(path, prepare=self.seals.install_views, require=self.file.require)

    def close(self) -> None:
        """Close all connections; closing twice has no effect."""
        self._readers.close()

    def writing(self) -> AbstractContextManager[sqlite3.Connection]:
        """Raise `StoreError`: only the process that opened the file for writing writes to it."""
        raise StoreError(f"{self._path}: this process only reads the database")

    @contextmanager
    def reading(self, unreadable: Unreadable = "strict") -> Iterator[sqlite3.Connection]:
        """Open a read-only transaction on one consistent state, and yield its connection.

        `unreadable` is the error handler of `bytes.decode` for stored text that is not UTF-8.
        """
        with self._store_errors(), self._readers.reading() as reader:
            if unreadable == "strict":
                yield reader
                return
            reader.text_factory = lambda text: text.decode("utf-8", unreadable)
            yield reader
            reader.text_factory = str

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Return whether a table with numbered rows ever had a row, including deleted rows."""
        return connection.execute(EVER_HAD, (table,)).fetchone() is not None

    def hold(self, name: str) -> FileHold:
        """Return a lock on a name, a lock file; entering it raises `StoreError` if it is held."""
        return held(self._path, name)

    @contextmanager
    def _store_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error, OverflowError, UnicodeEncodeError) as error:
            kind = RefusedRowError if is_of_the_row(error) else StoreError
            raise kind(error_message(self._path, error)) from error
        except UnicodeDecodeError as error:  # in an error message of SQLite
            raise StoreError(
                f"{self._path}: the file is damaged: invalid table names; restore a backup"
            ) from error


class SqliteDatabase(SqliteReading):
    """SQLite database of the store; used by several threads, one write transaction at a time.

    Parameters
    ----------
    path
        Path of the file; the file and its folder are created if missing.
    origin
        Origin of the stored data; a file with data of another origin is rejected. None for the
        file of accounts, sessions and keys.

    Attributes
    ----------
    had_trail
        Whether the file had an audit trail before it was opened.
    marks
        High-water mark of the database.

    Raises
    ------
    StoreError
        If the file cannot be opened, is damaged, belongs to another program, or has a newer schema
        than this program.
    """

    def __init__(self, path: Path, origin: Origin | None) -> None:
        self._begin(path)
        self.marks = CommitMarks(MarkFile(mark_path(path)), SystemClock().now_ns)
        with self._store_errors():
            if (unusable := why_unusable(path)) is not None:
                raise StoreError(unusable)
            if (cut := truncation_of(path)) is not None:
                raise StoreError(f"{path}: {cut}")
            connection = opened(path)
            try:
                self.had_trail = self._prepare(connection, origin)
            except BaseException:
                connection.close()
                raise
            self.file.remember()

    def close(self) -> None:
        """Close all connections; closing twice has no effect."""
        self._readers.close()  # first: the last connection that closes moves the WAL into the file
        with self.writer.lock:
            self.writer.close()
        self.file.keep_logs_apart()

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """Open a write transaction and yield its connection; the end of the block commits it.

        The commit also increments the commit counter, which is then written to the high-water mark.

        Raises
        ------
        StoreError
            If the transaction fails or the file was replaced; not if the mark cannot be written.
        """
        with self.writer.lock, self._store_errors():
            self.file.require()
            with self.writer.transaction() as writer:
                yield writer
                self.marks.count(writer)
            self.marks.settle()

    def give_back(self) -> bool:
        """Release free pages of the file to the file system; return False if none were released."""
        with self.writer.lock, self._store_errors():
            return self.writer.give_back()

    def _prepare(self, connection: sqlite3.Connection, origin: Origin | None) -> bool:
        """Migrate the file and open its writer; return whether it had an audit trail before."""
        in_file = self.marks.in_file()
        for setting in (f"page_size = {PAGE_BYTES}", "auto_vacuum = INCREMENTAL"):
            connection.execute(f"PRAGMA {setting}")  # effective only in a new file
        had_trail = connection.execute(HAS_TRAIL).fetchone() is not None
        migrate(connection, str(self._path), origin)  # first: a foreign file stays unchanged
        self.writer = Writer(self._path, connection, self.marks, self.seals.begin)
        with self.writer.transaction():
            self.marks.open(connection, in_file)
            self.seals.begin(connection)
        return had_trail
