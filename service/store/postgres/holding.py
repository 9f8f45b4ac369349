"""Names that one process holds among those that use a PostgreSQL database.

A name is an advisory lock of a session of its own. It ends with the session: when the process
ends, when the server is started anew, or, at the latest half a minute after, when the host or the
network between them is gone. So the holder has to look, by `PostgresHold.is_held`, before each
thing that only one may do; what it has lost stays lost.
"""

from threading import Lock
from types import TracebackType

import psycopg

from service.store.port import StoreError
from service.store.postgres.address import PostgresAddress
from service.store.postgres.connection import Session, connected
from service.store.postgres.errors import renamed
from service.store.postgres.locks import lock_number

TAKE = "SELECT pg_try_advisory_lock(%s)"
SETTINGS = "SET statement_timeout = '5s';"
HOLDER = """
    SELECT application_name, client_addr::text FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND objsubid = 1
    AND pg_locks.database = (SELECT oid FROM pg_database WHERE datname = current_database())
    AND ((classid::bigint << 32) | objid::bigint) = %s
"""


class PostgresHold:
    """A name held in a database, from entering to leaving.

    Parameters
    ----------
    address
        Of the database.
    name
        What is held.
    """

    def __init__(self, address: PostgresAddress, name: str) -> None:
        self._address, self._name = address, name
        self._session: Session | None = None
        self._lock = Lock()

    @property
    def is_held(self) -> bool:
        """Ask the server; False for ever once there was no answer."""
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
            self._session = connected(self._address, f"holds {self._name}", SETTINGS)
            try:
                self._take(self._session)
            except BaseException:
                self._end()
                raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
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
