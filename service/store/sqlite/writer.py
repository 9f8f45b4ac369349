"""`Writer`: the one connection that writes, and is not trusted after an error of the disk."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from service.store.highwater.commits import CommitMarks
from service.store.sqlite.readers import BUSY_TIMEOUT_S
from service.store.sqlite.trouble import leaves_in_doubt

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
