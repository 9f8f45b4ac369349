"""What was found damaged: how much, and where."""

from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock

MAX_PLACES = 1000
"""Places that are remembered; beyond it they are only counted."""


@dataclass(frozen=True)
class Place:
    """A row that is not what was written, or not there.

    Parameters
    ----------
    key
        What the row is found by, as it can be written down.
    is_missing
        Whether nothing is there at all.
    """

    table: str
    key: str
    is_missing: bool = False


class DamageLog:
    """Places that were found damaged since the start, each once; used from several threads.

    Parameters
    ----------
    most
        How many places are remembered.
    """

    def __init__(self, most: int = MAX_PLACES) -> None:
        self._most = most
        self._lock = Lock()
        self._places: dict[Place, None] = {}
        self._n_more = 0

    @property
    def n_damaged(self) -> int:
        """How many there are; beyond `most` one that is met again may count again."""
        return len(self._places) + self._n_more

    @property
    def places(self) -> Sequence[Place]:
        """Where, in the order in which they were found."""
        with self._lock:
            return list(self._places)

    def note(self, place: Place) -> None:
        """Remember a place."""
        with self._lock:
            if place in self._places:
                return
            if len(self._places) < self._most:
                self._places[place] = None
            else:
                self._n_more += 1
