"""Connections that only read: opening one costs more than most of what is read with it."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from acquisition.clock import SystemClock
from service.runtime.asker import ASKER

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
