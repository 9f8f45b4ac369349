"""`CounterAxis`: one unbroken sample axis from counters of any width."""

from dataclasses import dataclass
from enum import Enum

from core.units import NS_PER_S

_NEAR_FRAMES = 64
"""A frame that is further ahead or behind needs a second one that agrees before it is believed."""

_SILENCE_S = 1.0
"""So does the first frame after a silence, in which the device may have begun anew."""

_TIME_TOLERANCE_S = 0.5
_TIME_TOLERANCE = 0.05
"""How far the host's clock and a counter may disagree about a jump over a wrap."""


class Jump(Enum):
    """What two frames that agree with each other, but not with the axis, show."""

    GAP = "gap"
    RESTART = "restart"


@dataclass(frozen=True)
class Mark:
    """A counter as a frame had it.

    Parameters
    ----------
    counter
        In samples, from 0 to ``modulus``.
    arrived_ns
        By a clock of the host that is never set.
    """

    counter: int
    modulus: int
    arrived_ns: int


class CounterAxis:
    """Where the newest frame stands on the axis, and whether the next one can follow it.

    Parameters
    ----------
    samples_per_frame
        Of each channel.

    Attributes
    ----------
    newest
        Index of the newest frame's first sample; None before the first.
    """

    def __init__(self, rate_hz: float, samples_per_frame: int) -> None:
        self._rate_hz = rate_hz
        self._near = _NEAR_FRAMES * samples_per_frame
        self._newest_ns = 0
        self.newest: int | None = None

    def anchor(self, index: int, arrived_ns: int) -> None:
        """Begin the axis, or go on at another place."""
        self.newest, self._newest_ns = index, arrived_ns

    def place(self, counter: int, modulus: int, arrived_ns: int) -> int | None:
        """Index of a frame that is close to the newest one; None if it is not."""
        newest, half = self.newest, modulus // 2
        if newest is None:
            return None
        if arrived_ns != self._newest_ns:
            silence = self._elapsed(arrived_ns)
            if silence > min(_SILENCE_S * self._rate_hz, half):
                return None
        ahead = (counter - newest) % modulus
        if ahead <= min(self._near, half):
            self.newest, self._newest_ns = newest + ahead, arrived_ns
            return newest + ahead
        behind = modulus - ahead
        return newest - behind if behind <= min(self._near, half // 2) else None

    def agrees(self, doubted: Mark, mark: Mark) -> bool:
        """Whether a frame follows a doubted one closely."""
        modulus = min(doubted.modulus, mark.modulus)
        ahead = (mark.counter - doubted.counter) % modulus
        return ahead <= min(self._near, modulus // 2)

    def left(self, modulus: int) -> Mark:
        """Where the axis stands, as a place to come back to."""
        return Mark((self.newest or 0) % modulus, modulus, self._newest_ns)

    def resumes(self, left: Mark, mark: Mark) -> bool:
        """Whether a frame goes on at a place that was left within the last second."""
        silent_s = (mark.arrived_ns - left.arrived_ns) / NS_PER_S
        ahead = (mark.counter - left.counter) % mark.modulus
        return silent_s <= _SILENCE_S and 0 < ahead <= self._near + silent_s * self._rate_hz

    def gap(self, mark: Mark) -> int:
        """Index of a place that is not before the newest frame; the clock tells whole wraps."""
        forward = self._forward(mark)
        n_wraps = max(0, round((self._elapsed(mark.arrived_ns) - forward) / mark.modulus))
        return (self.newest or 0) + forward + n_wraps * mark.modulus

    def jump(self, mark: Mark, tells_restarts: bool) -> tuple[Jump, int]:
        """What frames at a new place show, and the index of that place.

        A counter that went up shows a gap. One that went down has wrapped, if that takes as long
        as it took, or if the device would have told a restart; else the device counts anew.
        """
        index = self.gap(mark)
        went_up = mark.counter >= (self.newest or 0) % mark.modulus
        wrapped = tells_restarts and self._forward(mark) <= mark.modulus // 2
        if went_up or wrapped or self._takes_as_long(index, mark):
            return Jump.GAP, index
        return Jump.RESTART, mark.counter

    def _forward(self, mark: Mark) -> int:
        return (mark.counter - (self.newest or 0)) % mark.modulus

    def _takes_as_long(self, index: int, mark: Mark) -> bool:
        elapsed = self._elapsed(mark.arrived_ns)
        tolerance = _TIME_TOLERANCE_S * self._rate_hz + _TIME_TOLERANCE * elapsed
        return abs(index - (self.newest or 0) - elapsed) <= tolerance

    def _elapsed(self, arrived_ns: int) -> float:
        """Samples that passed by the host's clock since the newest frame."""
        return max(0, arrived_ns - self._newest_ns) / NS_PER_S * self._rate_hz
