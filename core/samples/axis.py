"""Sample axis of one device: converts a counter of any width to an index that never wraps.

Every adapter places its samples on a `SampleAxis`; the rules of its protocol decide which counter
values are accepted.
"""

from dataclasses import dataclass

from core.units import NS_PER_S

DEVICE_EPOCHS = 1 << 32
"""Limit of the epochs that a device reports. If an adapter also numbers epochs of the same device,
its numbers are above this limit."""

RECOUNTED_EPOCHS = 1 << 33
"""Smallest epoch assigned to a sample count that restarted without a new epoch from the device; the
start time in seconds is added."""


@dataclass(frozen=True)
class ClockTolerance:
    """Tolerance between a clock and a sample count, or between two clocks.

    The defaults allow clock corrections of one second and a drift of 0.1 %.

    Parameters
    ----------
    step_s
        Constant deviation, independent of the elapsed time.
    drift
        Deviation as a fraction of the elapsed time.
    """

    step_s: float = 1.0
    drift: float = 1e-3

    def over(self, elapsed: float, per_s: float = NS_PER_S) -> float:
        """Return the largest allowed deviation after an elapsed time, in the unit of that time.

        The unit is 1 / per_s seconds; by default, a nanosecond.
        """
        return self.step_s * per_s + self.drift * abs(elapsed)


class Epochs:
    """Epoch numbers of one device's sample counts, across restarts of its adapter.

    The adapter loses its own state (wraps of a narrow counter, restarts that the device did not
    report) when its process ends. It therefore numbers such sample counts itself: its start time in
    seconds plus the number of restarts since. The numbers are unique if a count restarts less than
    once per second. Only a device that reports its epoch, and whose counter needs no unwrapping,
    keeps its epoch when the adapter restarts.

    Parameters
    ----------
    begun_ns
        Start time of this run of the adapter, UTC.
    trusts_device
        Whether the epoch reported by the device identifies its sample count.

    Attributes
    ----------
    number
        Epoch number of the current sample count.
    """

    def __init__(self, begun_ns: int, *, trusts_device: bool) -> None:
        self._trusts_device = trusts_device
        self._own = begun_ns // NS_PER_S + (DEVICE_EPOCHS if trusts_device else 0)
        self.number = 0 if trusts_device else self._own

    def begin_first(self, reported: int) -> None:
        """Set the epoch of the first sample count to the reported one, if the device is trusted."""
        if self._trusts_device:
            self.number = reported % DEVICE_EPOCHS

    def begin(self, reported: int | None = None) -> None:
        """Begin a new sample count; `reported` is None if the device reported no new epoch."""
        self._own += 1
        if reported is not None and self._trusts_device:
            self.number = reported % DEVICE_EPOCHS
        else:
            self.number = self._own


def signed_distance(counter: int, reference: int, modulus: int) -> int:
    """Return the shortest signed distance from a reference to a counter that wraps at `modulus`."""
    half = modulus // 2
    return (counter - reference + half) % modulus - half


class SampleAxis:
    """Current sample index of one device, from which its wrapping counter is unwrapped.

    Attributes
    ----------
    index
        Current sample index; None before the first sample.
    at_ns
        Time of a monotonic clock at which the index was reached, in nanoseconds.
    """

    def __init__(self, rate_hz: float, epochs: Epochs) -> None:
        self.epochs = epochs
        self._rate_hz = rate_hz
        self.at_ns = 0
        self.index: int | None = None

    @property
    def epoch(self) -> int:
        """Epoch number of the current sample count."""
        return self.epochs.number

    def stand_at(self, index: int, at_ns: int) -> None:
        """Set the current sample index, and the monotonic time at which it was reached."""
        self.index, self.at_ns = index, at_ns

    def forward(self, counter: int, modulus: int) -> int:
        """Return the number of samples, below `modulus`, from the current index to a counter."""
        return (counter - (self.index or 0)) % modulus

    def jump(self, counter: int, modulus: int, at_ns: int) -> int:
        """Return the number of samples from the index to a counter value, reached at `at_ns`.

        It includes the whole turns of the counter that best fit the elapsed time.
        """
        forward = self.forward(counter, modulus)
        return forward + modulus * max(0, round((self.elapsed(at_ns) - forward) / modulus))

    def elapsed(self, at_ns: int) -> float:
        """Return the nominal number of samples from the current index to a monotonic time."""
        return max(0, at_ns - self.at_ns) / NS_PER_S * self._rate_hz

    def allowance(self, at_ns: int, tolerance: ClockTolerance) -> float:
        """Return the allowed difference, in samples, of a counted jump from the elapsed time."""
        return tolerance.over(self.elapsed(at_ns), self._rate_hz)
