"""Pool of idle read-only connections, common to SQLite and PostgreSQL."""

from threading import Lock
from typing import Generic, Protocol, TypeVar

N_KEPT = 4
"""Maximum number of idle connections."""


class _Closable(Protocol):
    def close(self) -> None: ...


Connection = TypeVar("Connection", bound=_Closable)


class Pool(Generic[Connection]):
    """Idle connections of one database; a connection in use is not in the pool."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._idle: list[Connection] = []
        self.is_closed = False

    def take(self) -> Connection | None:
        """Remove an idle connection from the pool and return it; None if the pool is empty."""
        with self._lock:
            return self._idle.pop() if self._idle else None

    def put_back(self, connection: Connection) -> None:
        """Add a connection, or close it if the pool is closed or full."""
        with self._lock:
            if not self.is_closed and len(self._idle) < N_KEPT:
                self._idle.append(connection)
                return
        connection.close()

    def close(self) -> None:
        """Close idle connections now, and connections in use when they are put back."""
        with self._lock:
            self.is_closed = True
            idle, self._idle = self._idle, []
        for connection in idle:
            connection.close()
