"""All open connections: how many there may be, and which have taken too long."""

from collections import defaultdict
from collections.abc import Callable
from typing import Protocol

from service.settings.processes import HttpLimitSettings

MAX_UNSENT_BYTES = 64 * 1024 * 1024
"""Answers that wait for slow readers, all together; beyond it the largest are given up."""

MAX_PAUSE_S = 1.0
"""The server looks at its connections more often; when it could not, no client is to blame."""


class Connection(Protocol):
    """One connection, as far as counting and deadlines need it."""

    peer: str
    """Address of the other end; empty for a socket file."""

    def check(self, now_s: float) -> None:
        """Close it if a deadline has passed."""

    def excuse(self, seconds: float) -> None:
        """Do not count a time in which nobody was listened to."""

    def waits_since(self) -> tuple[bool, float] | None:
        """When nothing of it is worked on: whether it ever asked, and since when it waits."""

    def n_unsent(self) -> int:
        """Bytes of answers that the other end has not taken."""

    def give_way(self) -> None:
        """Close it in favour of another one."""

    def abort(self) -> None:
        """Close it at once, whatever is unsent."""


class Connections:
    """The open connections of a server.

    Parameters
    ----------
    now_s
        Steady time in seconds; tests bring their own.
    """

    def __init__(self, limits: HttpLimitSettings, now_s: Callable[[], float]) -> None:
        self.limits, self.now_s = limits, now_s
        self._of_peer: defaultdict[str, set[Connection]] = defaultdict(set)
        self._n_open = self.n_accepted = 0
        self._swept_s = now_s()

    def __len__(self) -> int:
        return self._n_open

    def admit(self, connection: Connection) -> bool:
        """Count a new connection in; False if there is no room that another could make."""
        neighbours = self._of_peer[connection.peer]
        if len(neighbours) >= self.limits.max_connections_per_peer:
            has_room = _make_room(neighbours)
        elif self._n_open >= self.limits.max_connections:
            has_room = _make_room(self.all())
        else:
            has_room = True
        # closing ones are counted until they are gone
        neighbours.add(connection)
        self._n_open += 1
        self.n_accepted += 1
        return has_room

    def leave(self, connection: Connection) -> None:
        """Count a connection out that is closed."""
        neighbours = self._of_peer[connection.peer]
        neighbours.remove(connection)
        self._n_open -= 1
        if not neighbours:
            del self._of_peer[connection.peer]

    def sweep(self) -> None:
        """Close what has passed a deadline; called again and again."""
        now_s = self.now_s()
        stalled_s = max(0.0, now_s - self._swept_s - MAX_PAUSE_S)
        self._swept_s = now_s
        for connection in self.all():
            connection.excuse(stalled_s)
            connection.check(now_s)
        self._relieve()

    def abort_all(self) -> None:
        """Close everything at once."""
        for connection in self.all():
            connection.abort()

    def all(self) -> set[Connection]:
        """Those that are open."""
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
    """Close the one that waits longest, those first that never asked anything."""
    waiting = [(since, each) for each in connections if (since := each.waits_since())]
    if not waiting:
        return False
    _, longest = min(waiting, key=lambda pair: pair[0])
    longest.give_way()
    return True
