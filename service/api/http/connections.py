"""Open connections of the HTTP server: their number and deadlines."""

from collections import defaultdict
from collections.abc import Callable
from typing import Protocol

from service.settings.processes import HttpLimitSettings

MAX_UNSENT_BYTES = 64 * 1024 * 1024
"""Maximum total of unsent bytes; above it the largest answers are aborted."""

MAX_PAUSE_S = 1.0
"""Longest pause between sweeps that counts towards deadlines, s."""


class Connection(Protocol):
    """Connection as seen by counts and deadlines."""

    peer: str
    """Address of the client; empty for a socket file."""

    def check(self, now_s: float) -> None:
        """Close the connection if a deadline has passed."""

    def excuse(self, seconds: float) -> None:
        """Exclude a time in which the server was paused from the deadlines."""

    def waits_since(self) -> tuple[bool, float] | None:
        """Return whether it ever sent a request, and the start of its wait; None if busy."""

    def n_unsent(self) -> int:
        """Return the number of unsent bytes."""

    def give_way(self) -> None:
        """Close the connection in favour of another."""

    def abort(self) -> None:
        """Abort the connection."""


class Connections:
    """The open connections of a server.

    Parameters
    ----------
    now_s
        Monotonic time, s.
    """

    def __init__(self, limits: HttpLimitSettings, now_s: Callable[[], float]) -> None:
        self.limits, self.now_s = limits, now_s
        self._of_peer: defaultdict[str, set[Connection]] = defaultdict(set)
        self._n_open = self.n_accepted = 0
        self._swept_s = now_s()

    def __len__(self) -> int:
        return self._n_open

    def admit(self, connection: Connection) -> bool:
        """Add a connection; return False if there is no room for it."""
        neighbours = self._of_peer[connection.peer]
        if len(neighbours) >= self.limits.max_connections_per_peer:
            has_room = _make_room(neighbours)
        elif self._n_open >= self.limits.max_connections:
            has_room = _make_room(self.all())
        else:
            has_room = True
        # closing connections count until they are closed
        neighbours.add(connection)
        self._n_open += 1
        self.n_accepted += 1
        return has_room

    def leave(self, connection: Connection) -> None:
        """Remove a closed connection."""
        neighbours = self._of_peer[connection.peer]
        neighbours.remove(connection)
        self._n_open -= 1
        if not neighbours:
            del self._of_peer[connection.peer]

    def sweep(self) -> None:
        """Close connections past a deadline; called periodically."""
        now_s = self.now_s()
        stalled_s = max(0.0, now_s - self._swept_s - MAX_PAUSE_S)
        self._swept_s = now_s
        for connection in self.all():
            connection.excuse(stalled_s)
            connection.check(now_s)
        self._relieve()

    def abort_all(self) -> None:
        """Abort all connections."""
        for connection in self.all():
            connection.abort()

    def all(self) -> set[Connection]:
        """Return the open connections."""
        return set().union(*self._of_peer.values())

    def _relieve(self) -> None:
        unsent = {each: n for each in self.all() if (n := each.n_unsent())}
        total = sum(unsent.values())
        for each in sorted(unsent, key=unsent.__getitem__, reverse=True):
            if total <= MAX_UNSENT_BYTES:
                return
            total -= unsent[each]
            each.abort()


def _make_room(connections: set[Connection]) -> bool:
    """Close the connection that waits longest, preferring those without a request."""
    waiting = [(since, each) for each in connections if (since := each.waits_since())]
    if not waiting:
        return False
    _, longest = min(waiting, key=lambda pair: pair[0])
    longest.give_way()
    return True
