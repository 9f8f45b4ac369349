"""PostgreSQL database: one writing session, several reading sessions, and named locks."""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Lock

import psycopg

from service.settings.storage import Origin
from service.store.database import Connection, Unreadable
from service.store.pool import Pool
from service.store.port import StoreError
from service.store.postgres.connection import (
    WRITING,
    PostgresAddress,
    PostgresConnection,
    Session,
    cancelled_when_gone,
    connected,
    lock_number,
    renamed,
    require_fit,
    sentence,
)
from service.store.postgres.schema import migrate

READER_SETTINGS = """
    SET default_transaction_read_only = on; SET statement_timeout = '30s';
"""
BEGIN_READING = b"BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"


class Readers:
    """Pool of read-only sessions of one database; each is used by one thread at a time."""

    def __init__(self, address: PostgresAddress) -> None:
        self._address = address
        self._pool = Pool[Session]()
        self.close = self._pool.close

    @contextmanager
    def reading(self) -> Iterator[PostgresConnection]:
        """Open a read-only transaction in a pooled session, and yield its connection.

        Raises `StoreError` if the server fails or the HTTP client has disconnected.
        """
        with renamed(self._address.name):
            session = self._begun()
            try:
                with cancelled_when_gone(session):
                    yield PostgresConnection(session)
                session.execute("COMMIT")
            except BaseException:
                session.close()
                raise
            self._pool.put_back(session)

    def _begun(self) -> Session:
        if self._pool.is_closed:
            raise StoreError(f"{self._address.name}: this process has closed its connections")
        while (idle := self._pool.take()) is not None:
            try:
                idle.execute(BEGIN_READING)
            except psycopg.OperationalError:  # the server has been restarted since
                idle.close()
            else:
                return idle
        session = connected(self._address, "reader", READER_SETTINGS)
        session.execute(BEGIN_READING)
        return session


WRITER_SETTINGS = """
    SET synchronous_commit = on; SET lock_timeout = '20s'; SET statement_timeout = '60s';
"""
BEGIN_WRITING = f"""
    BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE; SELECT pg_advisory_xact_lock({WRITING});
"""
NUMBER = "SELECT pg_current_xact_id()::text"
OUTCOME = "SELECT pg_xact_status(%s::xid8)"
"""Query of a transaction's status; ``in progress`` while the lost session still exists."""

DOUBT_S = 8.0
"""Maximum time to determine the outcome of a commit after the connection was lost."""

PAUSE_S = 0.2


class Writer:
    """Session for write transactions; only one of these is open at a time among all processes."""

    def __init__(self, address: PostgresAddress, session: Session) -> None:
        self._address, self._where = address, address.name
        self._session, self._lock = session, Lock()
        self._is_closed = False

    def close(self) -> None:
        """Close the session; closing it twice has no effect."""
        with self._lock:
            self._is_closed = True
            self._session.close()

    @contextmanager
    def writing(self) -> Iterator[PostgresConnection]:
        """Open a write transaction and yield its connection; the end of the block commits it.

        An error in the block rolls it back. Raises `StoreError` if the server fails.
        """
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
            raise StoreError(f"{self._where}: this process has closed its connection")
        if not self._session.closed:
            try:
                return self._begun()
            except psycopg.OperationalError:
                if not self._session.closed:
                    self._roll_back()
                    raise
        self._session = _writing_session(self._address)  # the previous session was lost
        return self._begun()

    def _begun(self) -> str:
        try:
            self._session.execute(BEGIN_WRITING.encode())
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
                raise StoreError(
                    f"{self._where}: nothing was written: the server rolled the transaction back"
                    " after an error"
                )

    def _settle(self, number: str, lost: psycopg.Error) -> None:
        """Determine the outcome of a commit without a reply; raise an error unless it succeeded."""
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
            f"{self._where}: the connection was lost during a commit; it is unknown whether the"
            " transaction is stored"
        )

    def _outcome(self, number: str) -> str | None:
        try:
            if self._session.closed:
                self._session = _writing_session(self._address)
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
            self._session.close()  # also rolls back


def _writing_session(address: PostgresAddress) -> Session:
    """Return a new session for write transactions on a suitable server.

    Raises
    ------
    StoreError
        If the server is unsuitable.
    psycopg.Error
        If the server cannot be reached or rejects the connection.
    """
    session = connected(address, "writer", WRITER_SETTINGS)
    try:
        require_fit(session, address.name)
    except BaseException:
        session.close()
        raise
    return session


TAKE = "SELECT pg_try_advisory_lock(%s)"
HOLD_SETTINGS = "SET statement_timeout = '5s';"
HOLDER = """
    SELECT application_name, client_addr::text FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND objsubid = 1
    AND pg_locks.database = (SELECT oid FROM pg_database WHERE datname = current_database())
    AND ((classid::bigint << 32) | objid::bigint) = %s
"""


class PostgresHold:
    """Exclusive lock on a name, an advisory lock in a separate session; a context manager.

    The lock ends with the session: when the process ends, when the server restarts, or at most half
    a minute after the host or the network fails. The holder must therefore check `is_held` before
    every action that only one process may take; a lost lock is never regained.
    """

    def __init__(self, address: PostgresAddress, name: str) -> None:
        self._address, self._name = address, name
        self._session: Session | None = None
        self._lock = Lock()

    @property
    def is_held(self) -> bool:
        """Whether the server still answers in the session of the lock; False after any failure."""
        with self._lock:
            if self._session is None:
                return False
            try:
                self._session.execute("SELECT 1")
            except psycopg.Error:
                self._end()
                return False
            return True

    def __enter__(self) -> "PostgresHold":
        with renamed(self._address.name):
            self._session = connected(self._address, f"holds {self._name}", HOLD_SETTINGS)
            try:
                self._take(self._session)
            except BaseException:
                self._end()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._end()

    def _take(self, session: Session) -> None:
        number = lock_number(self._name)
        if session.execute(TAKE, (number,)).fetchone() == (True,):
            return
        row = session.execute(HOLDER, (number,)).fetchone()
        holder = "unknown" if row is None else " at ".join(str(part) for part in row if part)
        raise StoreError(
            f"{self._name} is held by another padwatch ({holder}) in {self._address.name}:"
            " stop it first"
        )

    def _end(self) -> None:
        if self._session is not None:
            self._session.close()
            self._session = None


class PostgresDatabase:
    """PostgreSQL database of the store; may be used by several threads and processes.

    Parameters
    ----------
    address
        Address of the database, which must exist and must be empty or created by padwatch.
    origin
        Origin of the stored data; a database with data of another origin is rejected.

    Raises
    ------
    StoreError
        If the database cannot be reached or used, belongs to another program, or has a newer
        schema than this program.
    """

    kind = "postgresql"

    def __init__(self, address: PostgresAddress, origin: Origin) -> None:
        self.address = address
        with renamed(address.name):
            session = _writing_session(address)
            try:
                migrate(session, address.name, origin)
            except BaseException:
                session.close()
                raise
        self._writer, self._readers = Writer(address, session), Readers(address)

    def close(self) -> None:
        """Close all sessions; closing twice has no effect."""
        self._readers.close()
        self._writer.close()

    def writing(self) -> AbstractContextManager[PostgresConnection]:
        """Open a write transaction, the only one among all processes; yield its connection."""
        return self._writer.writing()

    @contextmanager
    def reading(
        self,
        unreadable: Unreadable = "strict",  # noqa: ARG002
    ) -> Iterator[PostgresConnection]:
        """Open a read-only transaction and yield its connection; all text is valid UTF-8."""
        with self._readers.reading() as reader:
            yield reader

    def ever_had(self, connection: Connection, table: str) -> bool:  # noqa: ARG002
        """Return True for every table, without a query.

        A missing head file of the audit trail is therefore always an error with PostgreSQL.
        """
        return True

    def hold(self, name: str) -> PostgresHold:
        """Return an advisory lock on a name; entering it raises `StoreError` if it is held."""
        return PostgresHold(self.address, name)
