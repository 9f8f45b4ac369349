"""`HostStamps`: times of samples from when they arrive, for a device that stamps none itself."""

from core.units import NS_PER_S

_BIN_S = 10.0
_MAX_SLEW = 200e-6
"""Share by which the line may run faster or slower: twice what a poor crystal is off."""

_STEP_NS = NS_PER_S
"""A line that is further off than this does not follow a drift: the host's clock was set."""


class HostStamps:
    """A straight line through the arrivals: smooth, always rising, bent every ten seconds.

    Samples can arrive late, never early. Therefore the least delay of every ten seconds counts,
    and the line is led towards it by changing its slope, never by a jump; only if the host's clock
    was set, or the device counts anew, does it begin again.

    Parameters
    ----------
    rate_hz
        Nominal samples per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._bin_samples = round(_BIN_S * rate_hz)
        self._epoch: int | None = None
        self._index = 0
        self._ns = 0
        self._slope = 1.0
        self._least_delay_ns: int | None = None

    def add(self, epoch: int, stop_index: int, arrived_ns: int) -> None:
        """Note that the sample before an index had arrived; to be called before `start_ns`."""
        delay_ns = arrived_ns - self.start_ns(stop_index)
        if epoch != self._epoch or delay_ns < -_STEP_NS:
            self._begin(epoch, stop_index, arrived_ns)
            return
        if self._least_delay_ns is None or delay_ns < self._least_delay_ns:
            self._least_delay_ns = delay_ns
        if stop_index - self._index < self._bin_samples:
            return
        if self._least_delay_ns > _STEP_NS:
            self._begin(epoch, stop_index, arrived_ns)
        else:
            self._bend(stop_index, self._least_delay_ns)

    def start_ns(self, index: int) -> int:
        """Time of a sample, UTC nanoseconds since 1970; rises with the index within an epoch."""
        return self._ns + round((index - self._index) * self._period_ns * self._slope)

    def _begin(self, epoch: int, index: int, at_ns: int) -> None:
        self._epoch, self._slope = epoch, 1.0
        self._index, self._ns, self._least_delay_ns = index, at_ns, None

    def _bend(self, index: int, late_ns: int) -> None:
        """From here on run so that the line meets the least delay in ten seconds."""
        at_ns = self.start_ns(index)
        share = late_ns / (_BIN_S * NS_PER_S)
        self._slope = 1.0 + min(max(share, -_MAX_SLEW), _MAX_SLEW)
        self._index, self._ns, self._least_delay_ns = index, at_ns, None
