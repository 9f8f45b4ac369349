"""SQLite under the store: WAL, synchronous=FULL, one writer, short reads."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from acquisition.clock import SystemClock
from service.origin import Origin
from service.store.database import Connection, Unreadable
from service.store.highwater.commits import CommitMarks
from service.store.highwater.file import MarkFile, mark_path
from service.store.port import StoreError
from service.store.sqlite.file_length import why_cut
from service.store.sqlite.holding import FileHold, held
from service.store.sqlite.migrating import migrate
from service.store.sqlite.readers import BUSY_TIMEOUT_S, Readers

PAGE_BYTES = 8192
"""In pages of half that size, a result of all quantities would need a page of its own."""

EVER_HAD = "SELECT 1 FROM sqlite_sequence WHERE name = ?"
HAS_TRAIL = "SELECT 1 FROM sqlite_master WHERE name = 'audit'"


class SqliteDatabase:
    """One database file; may be used from several threads, writes are taken one at a time.

    Parameters
    ----------
    path
        Created, with its folder, if it does not exist.
    origin
        What it is to hold; a file that holds the other is refused.

    Attributes
    ----------
    had_trail
        Whether there was an audit trail in it before it was opened.
    marks
        Whether it is the database that was here last.

    Raises
    ------
    StoreError
        If the file cannot be opened, is not padwatch's, is damaged, or is newer than this program.
    """

    kind = "sqlite"

    def __init__(self, path: Path, origin: Origin) -> None:
        self._path = path
        self.lock = Lock()
        self._readers = Readers(path)
        self.marks = CommitMarks(MarkFile(mark_path(path)), SystemClock().now_ns)
        with self._renamed_errors():
            path.parent.mkdir(parents=True, exist_ok=True)
            if (cut := why_cut(path)) is not None:
                raise StoreError(f"{path}: {cut}")
            self.writer = sqlite3.connect(
                path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
            )
            try:
                self.had_trail = self._prepare(origin)
            except BaseException:
                self.writer.close()
                raise

    def close(self) -> None:
        """Release the file; closing twice is fine."""
        self._readers.close()  # first: the last to close brings the journal into the file
        with self.lock:
            self.writer.close()

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction of the one writer; durable, and marked as such, when left."""
        with self.lock, self._renamed_errors():
            with self._transaction():
                yield self.writer
                self.marks.count(self.writer)
            self.marks.settle()

    @contextmanager
    def reading(self, unreadable: Unreadable = "strict") -> Iterator[sqlite3.Connection]:
        """Open a look at one state of the file."""
        with self._renamed_errors(), self._readers.reading() as reader:
            if unreadable == "strict":
                yield reader
                return
            reader.text_factory = lambda text: text.decode("utf-8", unreadable)
            yield reader
            reader.text_factory = str

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Whether a table that numbers its rows ever had one."""
        return connection.execute(EVER_HAD, (table,)).fetchone() is not None

    def hold(self, name: str) -> FileHold:
        """Take a name, by the lock of a file beside the database."""
        return held(self._path, name)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self.writer.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.writer.execute("COMMIT")
        finally:
            # a full disk has rolled back already; a refused commit leaves the transaction open
            if self.writer.in_transaction:
                self.writer.execute("ROLLBACK")

    def _prepare(self, origin: Origin) -> bool:
        """Bring the file up to date; whether it had an audit trail before."""
        said = self.marks.said()
        self.writer.execute(f"PRAGMA page_size = {PAGE_BYTES}")  # of a file yet to be written
        had_trail = self.writer.execute(HAS_TRAIL).fetchone() is not None
        migrate(self.writer, str(self._path), origin)  # first: what is not ours stays as it is
        for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
            self.writer.execute(f"PRAGMA {setting}")
        with self._transaction():
            self.marks.open(self.writer, said)
        return had_trail

    @contextmanager
    def _renamed_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"{self._path}: {error}") from error
