"""Connections to a SQLite database: several readers and one writer."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from acquisition.clock import SystemClock
from service.runtime.asker import ASKER
from service.store.highwater.commits import CommitMarks
from service.store.sqlite.file import leaves_in_doubt

BUSY_TIMEOUT_S = 5.0
N_KEPT = 4
LOOK_AFTER_STEPS = 20_000
"""Steps of the database's machine, some tens of microseconds, after which a read looks whether
anybody still waits for it."""

CLOCK = SystemClock()
LONGEST_S = 120.0
"""A read that takes longer is ended: while it lasts, the log beside the file only grows."""


class Readers:
    """Read-only connections to one database; each is used by one thread at a time.

    Parameters
    ----------
    now_s
        Clock that only goes forward.
    prepare
        Makes a new connection fit for reading.
    require
        Raises where the file is no longer the one that was opened.
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
        self._lock = Lock()
        self._idle: list[sqlite3.Connection] = []
        self._is_closed = False

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """Borrow a connection; one with which something went wrong is not used again."""
        reader = self._taken()
        try:
            reader.set_progress_handler(self._is_in_vain(), LOOK_AFTER_STEPS)
            reader.execute("BEGIN")  # one state of the database until the end
            yield reader
            reader.set_progress_handler(None, 0)
            if reader.in_transaction:
                reader.execute("ROLLBACK")
        except BaseException:
            reader.close()
            raise
        self._put_back(reader)

    def close(self) -> None:
        """Close those that are not in use now, and the others as they are given back."""
        with self._lock:
            self._is_closed = True
            idle, self._idle = self._idle, []
        for reader in idle:
            reader.close()

    def _is_in_vain(self) -> Callable[[], bool]:
        """Whether a read that begins now should end: by the asker, or by time."""
        asker, end_s = ASKER.get(), self._now_s() + LONGEST_S
        return lambda: self._now_s() > end_s or (asker is not None and asker.has_gone)

    def _taken(self) -> sqlite3.Connection:
        self._require()
        with self._lock:
            if self._idle:
                return self._idle.pop()
        return self._opened()

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

    def _put_back(self, reader: sqlite3.Connection) -> None:
        with self._lock:
            if not self._is_closed and len(self._idle) < N_KEPT:
                self._idle.append(reader)
                return
        reader.close()


MAX_LOG_BYTES = 67_108_864
"""Of the ``-wal`` file; one that has grown while somebody read for long is cut to it."""

MIN_FREE_PAGES = 2000
MIN_FREE_SHARE = 0.1
"""Less free room than that is used again soon."""

PAGES_AT_ONCE = 200

ONLY_THEN = 2
"""``auto_vacuum = INCREMENTAL``."""


class Writer:
    """Writes to a file that is up to date; used by one thread at a time, under `lock`.

    A sync that fails is not tried again: the system may have dropped what was to be written and
    say that all is well. The connection is closed, and before the next transaction the file is
    opened anew and compared with the high-water mark beside it.

    Parameters
    ----------
    connection
        Open.
    marks
        Whether it is the database that was here last.
    prepare
        Makes a connection fit for writing, within a transaction.
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
        """Release the file; closing twice is fine."""
        self.connection.close()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction; durable when left."""
        if self._is_in_doubt:
            self._reopen()
        try:
            with _begun(self.connection):
                yield self.connection
        except sqlite3.Error as error:
            self._is_in_doubt = leaves_in_doubt(error)
            raise

    def give_back(self) -> bool:
        """Cut some free pages off the end of the file; whether there are more.

        A file that an older padwatch has made keeps them for itself, and uses them again.
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
        said = self._marks.said()
        self.connection = opened(self._path)
        set_up(self.connection)
        with _begun(self.connection):
            self._marks.open(self.connection, said)
            self._prepare(self.connection)
        self._is_in_doubt = False


def opened(path: Path) -> sqlite3.Connection:
    """A connection that may write, and can be used by any thread."""
    return sqlite3.connect(
        path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
    )


def set_up(connection: sqlite3.Connection) -> None:
    """Make every transaction durable."""
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
        # a full disk has rolled back already; a refused commit leaves the transaction open
        if connection.in_transaction:
            connection.execute("ROLLBACK")
