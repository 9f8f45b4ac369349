"""`CountedSamples`: a 16-bit counter of samples becomes an index that never wraps."""

from dataclasses import dataclass

WRAP = 65536

_SLACK_S = 0.5
"""How far a device may be ahead of the host's clock, or hold samples back."""

_DRIFT = 1e-3
"""A device's sampling may be wrong by a permille against the host's clock."""

_MOST_HELD = 31
"""Samples that a queue shows again if reading does not remove them."""


@dataclass(frozen=True)
class Place:
    """Where a sample belongs."""

    epoch: int
    index: int


class CountedSamples:
    """Unwraps a counter with the help of the host's clock, across connections.

    A jump that the time since the last sample explains is a gap, exact whatever times the counter
    has wrapped. One that it does not explain means that the device counts anew, or that it stopped
    and its counter with it: a new epoch.

    Parameters
    ----------
    removes
        If reading removes nothing, samples come again: those are told by their counter.
    epoch
        Of the first count.
    """

    def __init__(self, rate_hz: float, *, removes: bool, epoch: int) -> None:
        self._rate_hz, self._removes = rate_hz, removes
        self._epoch = epoch
        self._next: int | None = None
        self._at_s = self._seen_all_s = 0.0

    def note_seen_all(self, now_s: float) -> None:
        """Note that the device has no more samples: those that come next are taken from now on."""
        self._seen_all_s = now_s

    def is_ambiguous(self, now_s: float) -> bool:
        """Whether so much time has passed that old samples could pass for new ones.

        What is in the queue must then be thrown away first; what comes after it is fresh.
        """
        return self._next is not None and self._passed(now_s) >= WRAP / 2 - self._slack(now_s)

    def place(self, counter: int, now_s: float) -> Place | None:
        """Return where the next sample belongs; None if it came before."""
        if self._next is None:
            return self._put(counter, now_s)
        ahead = (counter - self._next) % WRAP
        if not self._removes and ahead >= WRAP - _MOST_HELD:
            return None
        passed = self._passed(now_s)
        jump = ahead + max(0, round((passed - ahead) / WRAP)) * WRAP
        fresh = passed < WRAP / 2 or jump >= passed - self._slack(now_s)
        least = (self._seen_all_s - self._at_s) * self._rate_hz - self._slack(now_s)
        if not least <= jump <= passed + self._slack(now_s) or not fresh:
            self._epoch += 1
            return self._put(counter, now_s)
        return self._put(self._next + jump, now_s)

    def _put(self, index: int, now_s: float) -> Place:
        self._next, self._at_s = index + 1, now_s
        return Place(self._epoch, index)

    def _passed(self, now_s: float) -> float:
        """Samples since the last one, by the host's clock."""
        return (now_s - self._at_s) * self._rate_hz

    def _slack(self, now_s: float) -> float:
        return _SLACK_S * self._rate_hz + _DRIFT * self._passed(now_s)
