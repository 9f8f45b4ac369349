"""`CommitMarks`: counts transactions in the database, and notes the count beside it."""

import os
from collections.abc import Callable, Sequence
from dataclasses import astuple
from typing import Any, Protocol

from service.store.highwater.comparison import MarkFinding, compared
from service.store.highwater.file import MarkError, MarkFile, NoMarkError
from service.store.highwater.host import host_id
from service.store.highwater.mark import Mark
from service.store.port import StoreError

CREATE = """
    CREATE TABLE IF NOT EXISTS high_water (
        id INTEGER PRIMARY KEY CHECK (id = 1),
        store TEXT NOT NULL,
        host TEXT NOT NULL,
        n_commits INTEGER NOT NULL,
        nonce TEXT NOT NULL,
        time_ns INTEGER NOT NULL
    ) STRICT
"""
"""No migration: PostgreSQL, where one row for all writers would hold them up, has no such table."""

COLUMNS = "store, host, n_commits, nonce, time_ns"
SELECT = """
    SELECT CAST(store AS BLOB), CAST(host AS BLOB), n_commits, CAST(nonce AS BLOB), time_ns
    FROM high_water WHERE id = 1
"""
"""Texts as bytes: what is damaged need not be text."""
PUT = f"INSERT OR REPLACE INTO high_water (id, {COLUMNS}) VALUES (1, ?, ?, ?, ?, ?)"  # noqa: S608


class Writer(Protocol):
    """A connection within a transaction."""

    def execute(self, statement: str, parameters: Any = ..., /) -> Any:
        """Carry out a statement."""
        ...


class CommitMarks:
    """The marks of one database, used by whoever holds its writer.

    Parameters
    ----------
    file
        Beside the database.
    now_ns
        Clock on the wall.
    host
        Name of this machine.
    """

    def __init__(
        self, file: MarkFile, now_ns: Callable[[], int], host: Callable[[], str] = host_id
    ) -> None:
        self._file, self._now_ns, self._host = file, now_ns, host()
        self._newest: Mark | None = None
        self.found: Sequence[MarkFinding] = ()
        self.error: str | None = None

    def open(self, writer: Writer, said: Mark | str | None) -> None:
        """Compare the file with the database that has just been opened, within a transaction.

        A database without a mark gets one, and so does the folder where there was none before.
        """
        writer.execute(CREATE)
        mark = select_mark(writer)
        if mark is None:
            mark = Mark(_chance(16), self._host, 0, _chance(8), self._now_ns())
            writer.execute(PUT, astuple(mark))
            if said is None:
                self._file.replace(mark)
                return
        self.found = compared("is not there" if said is None else said, mark, self._host)

    def count(self, writer: Writer) -> None:
        """Count the transaction that is about to be committed, in it."""
        if self.found:
            return  # what was found stays to be seen until it is adopted
        last = select_mark(writer)
        if last is None:
            raise StoreError("the database has lost its high-water mark")
        self._put(writer, last, last.n_commits + 1)

    def settle(self) -> None:
        """Note beside the database what has been committed.

        What is on the disk is not undone because of it: until it succeeds the file lags.
        """
        if self._newest is None or self.found:
            return
        try:
            self._file.advance(self._newest)
        except (OSError, MarkError) as error:
            self.error = f"{self._file.path}: {error}"
        else:
            self.error = None

    def adopt(self, writer: Writer) -> None:
        """Take the database as it is for the newest, within a transaction."""
        last, said = select_mark(writer), self.said()
        if last is None:
            raise StoreError("the database has lost its high-water mark")
        n_before = said.n_commits if isinstance(said, Mark) else 0
        # beyond both, so that no mark of before fits ever again
        self._put(writer, last, max(last.n_commits, n_before) + 1)

    def adopted(self) -> None:
        """Note beside the database what was adopted; if that fails, it will be found again."""
        if self._newest is None:
            return
        try:
            self._file.replace(self._newest)
        except OSError as error:
            self.error = f"{self._file.path}: {error}"
        else:
            self.found, self.error = (), None

    def _put(self, writer: Writer, last: Mark, n_commits: int) -> None:
        self._newest = Mark(last.store, self._host, n_commits, _chance(8), self._now_ns())
        writer.execute(PUT, astuple(self._newest))

    def said(self) -> Mark | str | None:
        """What the file says, or why it says nothing; None if it is not there.

        Before the database is opened to be compared with it: the file may lag, but not lead.
        """
        try:
            return self._file.read()
        except NoMarkError:
            return None
        except MarkError as error:
            return str(error)


def select_mark(reader: Writer) -> Mark | None:
    """Read the mark in a database; None if it has none yet."""
    row = reader.execute(SELECT).fetchone()
    if row is None:
        return None
    store, host, n_commits, nonce, time_ns = row
    texts = (bytes(text).decode("utf-8", "replace") for text in (store, host, nonce))
    store, host, nonce = texts
    return Mark(store, host, int(n_commits), nonce, int(time_ns))


def _chance(n_bytes: int) -> str:
    return os.urandom(n_bytes).hex()
