"""`Durations`: how long something takes, as a histogram that costs a search and three additions."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from threading import Lock

from acquisition.clock import Clock


@dataclass(frozen=True)
class Seen:
    """What a histogram holds at one moment.

    Parameters
    ----------
    bounds_s
        Upper bound of each bucket but the last, which has none.
    n_up_to
        How many took at most as long as each bound; the last entry counts all.
    sum_s
        What all of them took together.
    newest_s
        What the newest took; None before the first.
    """

    bounds_s: tuple[float, ...]
    n_up_to: tuple[int, ...]
    sum_s: float
    newest_s: float | None = None


class Durations:
    """Counts durations in buckets; may be told from any thread.

    Parameters
    ----------
    bounds_s
        Upper bounds of the buckets, rising.

    Raises
    ------
    ValueError
        If the bounds do not rise.
    """

    def __init__(self, bounds_s: Sequence[float], clock: Clock) -> None:
        if not bounds_s or list(bounds_s) != sorted(set(bounds_s)):
            raise ValueError(f"bounds of buckets must rise: {list(bounds_s)}")
        self._bounds_s, self._clock = tuple(bounds_s), clock
        self._n_in = [0] * (len(bounds_s) + 1)
        self._sum_s = 0.0
        self._newest_s: float | None = None
        self._lock = Lock()

    def observe(self, duration_s: float) -> None:
        """Count something that took so long."""
        place = bisect_left(self._bounds_s, duration_s)
        with self._lock:
            self._n_in[place] += 1
            self._sum_s += duration_s
            self._newest_s = duration_s

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Count how long the body takes, unless it fails."""
        began_s = self._clock.monotonic_s()
        yield
        self.observe(self._clock.monotonic_s() - began_s)

    def seen(self) -> Seen:
        """All that was counted so far."""
        with self._lock:
            n_up_to = tuple(accumulate(self._n_in))
            return Seen(self._bounds_s, n_up_to, self._sum_s, self._newest_s)
