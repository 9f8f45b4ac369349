"""SQLite under the store: WAL, synchronous=FULL, one writer, short reads."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
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
from service.store.sqlite.file import FileHold, OpenedFile, held, is_of_the_row, told, why_cut
from service.store.sqlite.migrating import migrate

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
    damage
        Rows that were found not to be what was written.
    marks
        Whether it is the database that was here last.
    file
        Whether its file is still the one that was opened.

    Raises
    ------
    StoreError
        If the file cannot be opened, is not padwatch's, is damaged, or is newer than this program.
    """

    kind = "sqlite"

    def __init__(self, path: Path, origin: Origin) -> None:
        self._path = path
        self.damage = DamageLog()
        self.seals = Seals(self.damage)
        self.file = OpenedFile(path)
        self._readers = Readers(path, prepare=self.seals.guard, require=self.file.require)
        self.marks = CommitMarks(MarkFile(mark_path(path)), SystemClock().now_ns)
        with self._renamed_errors():
            if (unusable := why_unusable(path)) is not None:
                raise StoreError(unusable)
            if (cut := why_cut(path)) is not None:
                raise StoreError(f"{path}: {cut}")
            connection = opened(path)
            try:
                self.had_trail = self._prepare(connection, origin)
            except BaseException:
                connection.close()
                raise
            self.file.remember()

    def close(self) -> None:
        """Release the file; closing twice is fine."""
        self._readers.close()  # first: the last to close brings the journal into the file
        with self.writer.lock:
            self.writer.close()
        self.file.keep_logs_apart()

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction of the one writer; durable, and marked as such, when left."""
        with self.writer.lock, self._renamed_errors():
            self.file.require()
            with self.writer.transaction() as writer:
                yield writer
                self.marks.count(writer)
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

    def give_back(self) -> bool:
        """Give some free room back to the disk; whether there is more."""
        with self.writer.lock, self._renamed_errors():
            return self.writer.give_back()

    def ever_had(self, connection: Connection, table: str) -> bool:
        """Whether a table that numbers its rows ever had one."""
        return connection.execute(EVER_HAD, (table,)).fetchone() is not None

    def hold(self, name: str) -> FileHold:
        """Take a name, by the lock of a file beside the database."""
        return held(self._path, name)

    def _prepare(self, connection: sqlite3.Connection, origin: Origin) -> bool:
        """Bring the file up to date; whether it had an audit trail before."""
        said = self.marks.said()
        for setting in (f"page_size = {PAGE_BYTES}", "auto_vacuum = INCREMENTAL"):
            connection.execute(f"PRAGMA {setting}")  # of a file yet to be written
        had_trail = connection.execute(HAS_TRAIL).fetchone() is not None
        migrate(connection, str(self._path), origin)  # first: what is not ours stays as it is
        self.writer = Writer(self._path, connection, self.marks, self.seals.begin)
        with self.writer.transaction():
            self.marks.open(connection, said)
            self.seals.begin(connection)
        return had_trail

    @contextmanager
    def _renamed_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error, OverflowError, UnicodeEncodeError) as error:
            kind = RefusedRowError if is_of_the_row(error) else StoreError
            raise kind(told(self._path, error)) from error
        except UnicodeDecodeError as error:  # in words of SQLite's about what is damaged
            raise StoreError(
                f"{self._path}: the file is damaged: names in it are no text"
            ) from error
