"""Sample axis of one device: a counter of any width becomes an index that never wraps.

Every adapter places what it reads on a `SampleAxis` and decides by rules of its own wire which
counters it believes.
"""

from dataclasses import dataclass

from core.units import NS_PER_S

DEVICE_EPOCHS = 1 << 32
"""Epochs that a device reports are below this; those that an adapter counts begin here."""

RECOUNTED_EPOCHS = 1 << 33
"""Epochs from here on are counts that began again without a new epoch, numbered by their second."""


@dataclass(frozen=True)
class ClockTolerance:
    """How far a clock and a count of samples, or two clocks, may disagree.

    The defaults are for a device whose clock may be corrected by a second and run a permille wrong.

    Parameters
    ----------
    step_s
        Independent of the time that has passed.
    drift
        Share of the time that has passed.
    """

    step_s: float = 1.0
    drift: float = 1e-3

    def over(self, elapsed: float, per_s: float = NS_PER_S) -> float:
        """Return the largest deviation over an elapsed time, both in units of 1/per_s seconds."""
        return self.step_s * per_s + self.drift * abs(elapsed)


class Epochs:
    """Numbers the counts of one device, across restarts of the adapter that reads it.

    What the adapter itself has counted, as the wraps of a narrow counter or restarts that the
    device did not report, is gone when its process ends. Such a count has a number of its own: the
    second in which the adapter began, plus the restarts since, fewer than one a second. Only
    a device that reports its epoch, and whose counter is wide enough to need no unwrapping, is on
    the same axis before and after.

    Parameters
    ----------
    begun_ns
        When this run of the adapter began, UTC.
    trusts_device
        Whether the epoch that the device reports identifies its count.

    Attributes
    ----------
    number
        Of the present count.
    """

    def __init__(self, begun_ns: int, *, trusts_device: bool) -> None:
        self._trusts_device = trusts_device
        self._own = begun_ns // NS_PER_S + (DEVICE_EPOCHS if trusts_device else 0)
        self.number = 0 if trusts_device else self._own

    def begin_first(self, reported: int) -> None:
        """Take over the epoch that the device reports of the first count."""
        if self._trusts_device:
            self.number = reported % DEVICE_EPOCHS

    def begin(self, reported: int | None = None) -> None:
        """Begin another count; its epoch is None where the device has reported no restart."""
        self._own += 1
        if reported is not None and self._trusts_device:
            self.number = reported % DEVICE_EPOCHS
        else:
            self.number = self._own


def signed_distance(counter: int, reference: int, modulus: int) -> int:
    """Distance from one reading of a counter to another, the short way round; may be negative."""
    half = modulus // 2
    return (counter - reference + half) % modulus - half


class SampleAxis:
    """Where one device stands on its sample axis, across connections.

    Attributes
    ----------
    index
        Where the axis stands; None before the first sample.
    at_ns
        When it came to stand there.
    """

    def __init__(self, rate_hz: float, epochs: Epochs) -> None:
        self.epochs = epochs
        self._rate_hz = rate_hz
        self.at_ns = 0
        self.index: int | None = None

    @property
    def epoch(self) -> int:
        """Number of the present count."""
        return self.epochs.number

    def stand_at(self, index: int, at_ns: int) -> None:
        """Begin the axis, or go on at another place, at a time by a clock that is never set."""
        self.index, self.at_ns = index, at_ns

    def forward(self, counter: int, modulus: int) -> int:
        """Samples from where the axis stands up to a counter's reading, without whole wraps."""
        return (counter - (self.index or 0)) % modulus

    def jump(self, counter: int, modulus: int, at_ns: int) -> int:
        """Samples up to a counter's reading, with as many whole wraps as the clock has seen."""
        forward = self.forward(counter, modulus)
        return forward + modulus * max(0, round((self.elapsed(at_ns) - forward) / modulus))

    def elapsed(self, at_ns: int) -> float:
        """Samples that a device takes in the time since the axis came to where it stands."""
        return max(0, at_ns - self.at_ns) / NS_PER_S * self._rate_hz

    def allowance(self, at_ns: int, tolerance: ClockTolerance) -> float:
        """Samples by which a jump up to now may differ from those that the clock expects."""
        return tolerance.over(self.elapsed(at_ns), self._rate_hz)
