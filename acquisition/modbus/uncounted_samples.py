"""`UncountedSamples`: samples of a device that does not count; loss shows by the clock alone."""

from collections import deque

from acquisition.modbus.counted_samples import Place

_BIN_S = 10.0
_N_BINS = 6
"""A minute: long against the jitter of polls, short against what a crystal drifts."""


class UncountedSamples:
    """Counts for the device, and begins a new epoch when it has not given what it must have.

    How many samples are missing is then not known, and nothing is joined across. A loss shorter
    than the tolerance cannot be seen.

    Parameters
    ----------
    tolerance_s
        Above the jitter of polls and replies.
    """

    def __init__(self, rate_hz: float, *, tolerance_s: float, epoch: int) -> None:
        self._rate_hz, self._tolerance_s = rate_hz, tolerance_s
        self._epoch, self._next = epoch - 1, 0
        self._delays: deque[tuple[int, float]] = deque(maxlen=_N_BINS)
        self.begin()

    def begin(self) -> None:
        """Begin a new epoch: at the start, on a new connection, or when samples were lost."""
        self._epoch += 1
        self._next = 0
        self._delays.clear()

    def place(self) -> Place:
        """Return where the next sample belongs."""
        self._next += 1
        return Place(self._epoch, self._next - 1)

    def has_lost(self, now_s: float) -> bool:
        """Whether samples are missing, now that the device has no more to give."""
        delay_s = now_s - self._next / self._rate_hz
        number = int(now_s // _BIN_S)
        if not self._delays or self._delays[-1][0] != number:
            self._delays.append((number, delay_s))
        else:
            self._delays[-1] = (number, min(self._delays[-1][1], delay_s))
        return delay_s - min(delay for _, delay in self._delays) > self._tolerance_s
