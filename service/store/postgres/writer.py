"""The one session that writes: opened again when it is lost, and never in doubt for long."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import psycopg

from service.store.port import StoreError
from service.store.postgres.address import PostgresAddress
from service.store.postgres.connection import (
    PostgresConnection,
    Session,
    connected,
    require_fit,
)
from service.store.postgres.errors import renamed, sentence
from service.store.postgres.locks import WRITING

SETTINGS = """
    SET synchronous_commit = on; SET lock_timeout = '20s'; SET statement_timeout = '60s';
"""
BEGIN = f"""
    BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE; SELECT pg_advisory_xact_lock({WRITING});
"""
NUMBER = "SELECT pg_current_xact_id()::text"
OUTCOME = "SELECT pg_xact_status(%s::xid8)"
"""``committed``, ``aborted``, or ``in progress`` while the lost session is still there."""

DOUBT_S = 8.0
"""How long the outcome of a commit is asked for that got no answer."""

PAUSE_S = 0.2


class Writer:
    """Transactions, one at a time among all processes.

    Parameters
    ----------
    address
        Of the database.
    session
        Open and fit.
    """

    def __init__(self, address: PostgresAddress, session: Session) -> None:
        self._address, self._where = address, address.name
        self._session, self._lock = session, Lock()
        self._is_closed = False

    def close(self) -> None:
        """End the session; closing twice is fine."""
        with self._lock:
            self._is_closed = True
            self._session.close()

    @contextmanager
    def writing(self) -> Iterator[PostgresConnection]:
        """Open a transaction, alone; durable when left."""
        with self._lock, renamed(self._where):
            number = self._begin()
            try:
                yield PostgresConnection(self._session)
            except BaseException:
                self._roll_back()
                raise
            self._commit(number)

    def _begin(self) -> str:
        if self._is_closed:
            raise StoreError(f"{self._where} is closed")
        if not self._session.closed:
            try:
                return self._begun()
            except psycopg.OperationalError:
                if not self._session.closed:
                    self._roll_back()
                    raise
        self._session = writing_session(self._address)  # it was lost since the last transaction
        return self._begun()

    def _begun(self) -> str:
        try:
            self._session.execute(BEGIN.encode())
            row = self._session.execute(NUMBER).fetchone()
        except psycopg.Error:
            self._roll_back()
            raise
        return "" if row is None else str(row[0])

    def _commit(self, number: str) -> None:
        try:
            done = self._session.execute("COMMIT")
        except psycopg.OperationalError as error:
            if not self._session.closed:
                self._roll_back()
                raise
            self._settle(number, error)
        else:
            if done.statusmessage != "COMMIT":
                raise StoreError(f"{self._where}: the transaction was undone by an error in it")

    def _settle(self, number: str, lost: psycopg.Error) -> None:
        """Ask what has become of a commit that got no answer; fail unless it is there."""
        until_s = time.monotonic() + DOUBT_S
        outcome = self._outcome(number)
        while outcome is None and time.monotonic() < until_s:
            time.sleep(PAUSE_S)
            outcome = self._outcome(number)
        if outcome == "committed":
            return
        if outcome == "aborted":
            raise StoreError(sentence(self._where, lost))
        raise StoreError(
            f"{self._where}: the connection was lost as results were written; whether they were"
            " is not known, so they are written again"
        )

    def _outcome(self, number: str) -> str | None:
        """What has become of a transaction; None while that cannot be known."""
        try:
            if self._session.closed:
                self._session = writing_session(self._address)
            row = self._session.execute(OUTCOME, (number,)).fetchone()
        except (psycopg.OperationalError, StoreError):
            return None
        return None if row is None or row[0] == "in progress" else row[0]

    def _roll_back(self) -> None:
        if self._session.closed:
            return
        try:
            self._session.execute("ROLLBACK")
        except psycopg.Error:
            self._session.close()  # which rolls back as well


def writing_session(address: PostgresAddress) -> Session:
    """Open a session that may write.

    Raises
    ------
    StoreError
        If the server is not fit for it.
    psycopg.Error
        If it cannot be reached, or refuses.
    """
    session = connected(address, "writer", SETTINGS)
    try:
        require_fit(session, address.name)
    except BaseException:
        session.close()
        raise
    return session
