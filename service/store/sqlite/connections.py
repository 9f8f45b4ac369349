"""Connections to a SQLite database: several readers and one writer."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from acquisition.clock import SystemClock
from service.runtime.asker import ASKER
from service.store.highwater.commits import CommitMarks
from service.store.pool import Pool
from service.store.sqlite.file import leaves_in_doubt

BUSY_TIMEOUT_S = 5.0
LOOK_AFTER_STEPS = 20_000
"""Number of SQLite instructions, some tens of microseconds, between two checks whether a query has
timed out or its client has disconnected."""

CLOCK = SystemClock()
LONGEST_S = 120.0
"""Maximum duration of a read transaction; the WAL file cannot shrink during a read."""


class Readers:
    """Pool of read-only connections to one database; each is used by one thread at a time.

    Parameters
    ----------
    now_s
        Function that returns monotonic time in seconds.
    prepare
        Function that prepares a new connection for reading.
    require
        Function that raises an error if the database file was removed or replaced.
    """

    def __init__(
        self,
        path: Path,
        now_s: Callable[[], float] = CLOCK.monotonic_s,
        prepare: Callable[[sqlite3.Connection], None] = lambda _: None,
        require: Callable[[], None] = lambda: None,
    ) -> None:
        self._prepare, self._now_s, self._require = prepare, now_s, require
        self._uri = f"{path.absolute().as_uri()}?mode=ro"
        self._pool = Pool[sqlite3.Connection]()
        self.close = self._pool.close

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """Open a read-only transaction on a pooled connection, and yield the connection.

        Raises `sqlite3.Error`, and the error of `require`.
        """
        self._require()
        reader = self._pool.take() or self._opened()
        try:
            reader.set_progress_handler(self._should_end(), LOOK_AFTER_STEPS)
            reader.execute("BEGIN")  # one consistent state for the whole block
            yield reader
            reader.set_progress_handler(None, 0)
            if reader.in_transaction:
                reader.execute("ROLLBACK")
        except BaseException:
            reader.close()
            raise
        self._pool.put_back(reader)

    def _should_end(self) -> Callable[[], bool]:
        """Return a callback that is true when a query has timed out or its client is gone."""
        asker, end_s = ASKER.get(), self._now_s() + LONGEST_S
        return lambda: self._now_s() > end_s or (asker is not None and asker.has_gone)

    def _opened(self) -> sqlite3.Connection:
        reader = sqlite3.connect(
            self._uri, uri=True, timeout=BUSY_TIMEOUT_S, check_same_thread=False
        )
        try:
            self._prepare(reader)
        except BaseException:
            reader.close()
            raise
        return reader


MAX_LOG_BYTES = 67_108_864
"""Size in bytes to which SQLite truncates the ``-wal`` file after a long read."""

MIN_FREE_PAGES = 2000
MIN_FREE_SHARE = 0.1
"""Minimum share of free pages in the file for a release; fewer pages are soon used again."""

PAGES_AT_ONCE = 200

ONLY_THEN = 2
"""Value of ``PRAGMA auto_vacuum`` for incremental vacuum."""


class Writer:
    """Write connection to a migrated file; used by one thread at a time, under `lock`.

    A failed sync is not repeated: the operating system may have lost the data, and a second sync
    may nevertheless succeed. Instead, the file is opened again before the next transaction and
    compared with the high-water mark beside it.

    Parameters
    ----------
    prepare
        Function that prepares a connection for writing, within a transaction.
    """

    def __init__(
        self,
        path: Path,
        connection: sqlite3.Connection,
        marks: CommitMarks,
        prepare: Callable[[sqlite3.Connection], None],
    ) -> None:
        self._path, self._marks, self._prepare = path, marks, prepare
        self.connection = connection
        self.lock = Lock()
        self._is_in_doubt = False
        set_up(connection)

    def close(self) -> None:
        """Close the connection; closing twice has no effect."""
        self.connection.close()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Open a write transaction and yield its connection; the end of the block commits it.

        An error in the block rolls it back. Raises `sqlite3.Error`, also if the commit fails.
        """
        if self._is_in_doubt:
            self._reopen()
        try:
            with _begun(self.connection):
                yield self.connection
        except sqlite3.Error as error:
            self._is_in_doubt = leaves_in_doubt(error)
            raise

    def give_back(self) -> bool:
        """Release some free pages at the end of the file; return False if no page was released.

        A file created without incremental vacuum keeps its free pages for reuse.
        """
        if self._number("auto_vacuum") != ONLY_THEN:
            return False
        n_free = self._number("freelist_count")
        if n_free < max(MIN_FREE_PAGES, MIN_FREE_SHARE * self._number("page_count")):
            return False
        self.connection.execute(f"PRAGMA incremental_vacuum({PAGES_AT_ONCE})").fetchall()
        return True

    def _number(self, setting: str) -> int:
        return int(self.connection.execute(f"PRAGMA {setting}").fetchone()[0])

    def _reopen(self) -> None:
        self.connection.close()
        in_file = self._marks.in_file()
        self.connection = opened(self._path)
        set_up(self.connection)
        with _begun(self.connection):
            self._marks.open(self.connection, in_file)
            self._prepare(self.connection)
        self._is_in_doubt = False


def opened(path: Path) -> sqlite3.Connection:
    """Return a new write connection that can be used by any thread."""
    return sqlite3.connect(
        path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
    )


def set_up(connection: sqlite3.Connection) -> None:
    """Configure a connection so that every transaction is durable."""
    for setting in (
        *("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"),
        f"journal_size_limit = {MAX_LOG_BYTES}",
    ):
        connection.execute(f"PRAGMA {setting}")


@contextmanager
def _begun(connection: sqlite3.Connection) -> Iterator[None]:
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    finally:
        # SQLite rolls back after a full disk, but not after a failed commit
        if connection.in_transaction:
            connection.execute("ROLLBACK")
