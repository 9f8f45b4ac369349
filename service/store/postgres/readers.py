"""Sessions that only read, each used by one thread at a time."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import psycopg

from service.store.port import StoreError
from service.store.postgres.address import PostgresAddress
from service.store.postgres.connection import (
    PostgresConnection,
    Session,
    cancelled_when_gone,
    connected,
)
from service.store.postgres.errors import renamed

N_KEPT = 4
SETTINGS = """
    SET default_transaction_read_only = on; SET statement_timeout = '30s';
"""
BEGIN = b"BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"


class Readers:
    """Read-only sessions of one database, opened as they are needed."""

    def __init__(self, address: PostgresAddress) -> None:
        self._address = address
        self._lock = Lock()
        self._idle: list[Session] = []
        self._is_closed = False

    @contextmanager
    def reading(self) -> Iterator[PostgresConnection]:
        """Borrow a session; one with which something went wrong is not used again."""
        with renamed(self._address.name):
            session = self._begun()
            try:
                with cancelled_when_gone(session):
                    yield PostgresConnection(session)
                session.execute("COMMIT")
            except BaseException:
                session.close()
                raise
            self._put_back(session)

    def close(self) -> None:
        """Close those that are not in use now, and the others as they are given back."""
        with self._lock:
            self._is_closed = True
            idle, self._idle = self._idle, []
        for session in idle:
            session.close()

    def _begun(self) -> Session:
        while (idle := self._taken()) is not None:
            try:
                idle.execute(BEGIN)
            except psycopg.OperationalError:  # the server was started anew since
                idle.close()
            else:
                return idle
        session = connected(self._address, "reader", SETTINGS)
        session.execute(BEGIN)
        return session

    def _taken(self) -> Session | None:
        with self._lock:
            if self._is_closed:
                raise StoreError(f"{self._address.name} is closed")
            return self._idle.pop() if self._idle else None

    def _put_back(self, session: Session) -> None:
        with self._lock:
            if not self._is_closed and len(self._idle) < N_KEPT:
                self._idle.append(session)
                return
        session.close()
