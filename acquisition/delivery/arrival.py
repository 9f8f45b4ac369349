"""When samples arrive, and what follows for their times and for the device's clock.

Samples can arrive late, never early. The least delay therefore shows how a device's clock stands
against the host's, and how late a sample is; all of this module follows from that.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from acquisition.clock import Clock
from core.samples.blocks import DeviceClock, StampFault
from core.units import NS_PER_S, ns_from_s


@dataclass(frozen=True)
class Arrival:
    """A moment by both clocks of the host.

    Parameters
    ----------
    host_ns
        UTC nanoseconds, by the clock that may be set.
    steady_s
        Seconds, by the clock that never steps.
    """

    host_ns: int
    steady_s: float

    @classmethod
    def now(cls, clock: Clock) -> "Arrival":
        """Now."""
        return cls(clock.now_ns(), clock.monotonic_s())

    def step_s_since(self, before: "Arrival") -> float:
        """Seconds by which the host's clock was set forward between two moments."""
        return (self.host_ns - before.host_ns) / NS_PER_S - (self.steady_s - before.steady_s)


_MAX_RISE_S = 1.0
"""Time at once for which the least delay is forgotten."""


class LeastDelay:
    """Least delay of samples on their way to the host; it counts as no delay.

    It is forgotten as fast as two clocks may drift apart.

    Parameters
    ----------
    max_drift
        Share by which the samples may come too slowly.

    Attributes
    ----------
    least_s
        The least delay, seconds; None before the first.
    """

    def __init__(self, max_drift: float) -> None:
        self._max_drift = max_drift
        self._at_s = 0.0
        self.least_s: float | None = None

    def late_s(self, delay_s: float, now_s: float) -> float:
        """Take a delay in; return how late that is, below zero if none before was as small."""
        if self.least_s is None:
            self.least_s, self._at_s = delay_s, now_s
        passed_s = min(max(0.0, now_s - self._at_s), _MAX_RISE_S)
        least_s = self.least_s + self._max_drift * passed_s
        self.least_s, self._at_s = min(least_s, delay_s), now_s
        return delay_s - least_s


_BIN_S = 10.0
_MAX_BINS = 360
"""An hour: long against the jitter of polls, short against the day of a crystal's temperature."""

_MIN_BINS = 6

_HOST_STEP_S = 0.5
"""A host's clock that is kept right is slewed; one that moves so much at once has been set."""


class ArrivalModel:
    """Offset of stamps by the host's wall clock, and drift of sampling by its steady one.

    Of every ten seconds only the block that came with the least delay counts; a line through these
    gives the drift, its scatter the uncertainty. If the host's clock is set, both begin anew: the
    offset is another one, and a host that was suspended has counted no time meanwhile.

    Parameters
    ----------
    rate_hz
        Nominal samples per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._bins: deque[tuple[float, float]] = deque(maxlen=_MAX_BINS)
        self._offset_ns: deque[int] = deque(maxlen=_MAX_BINS)
        self._epoch: int | None = None
        self._origin: tuple[int, float] = (0, 0.0)
        self._newest: Arrival | None = None
        self._bin = -1
        self._drift: tuple[float, float] | None = None

    def add(self, epoch: int, stop_index: int, stop_ns: int | None, arrived: Arrival) -> None:
        """Note that all samples up to an index had arrived.

        Parameters
        ----------
        stop_ns
            Time of that index by the device's stamps; None if it does not stamp.
        """
        if epoch != self._epoch or self._was_set(arrived):
            self._begin(epoch, stop_index, arrived.steady_s)
        self._newest = arrived
        host_s = arrived.steady_s - self._origin[1]
        delay_s = host_s - (stop_index - self._origin[0]) / self._rate_hz
        number = int(host_s // _BIN_S)
        offset_ns = None if stop_ns is None else stop_ns - arrived.host_ns
        if number != self._bin:
            self._drift = _slope(self._bins)
            self._bin = number
            self._bins.append((host_s, delay_s))
            if offset_ns is not None:
                self._offset_ns.append(offset_ns)
        else:
            self._bins[-1] = min(self._bins[-1], (host_s, delay_s), key=lambda pair: pair[1])
            if offset_ns is not None:
                self._offset_ns[-1] = max(self._offset_ns[-1], offset_ns)

    def device_clock(self, n_faults: int = 0) -> DeviceClock:
        """Return offset and drift as far as they are known now."""
        offset_ns = max(list(self._offset_ns)[-_MIN_BINS:], default=None)
        drift = None if self._drift is None else -1e6 * self._drift[0]
        return DeviceClock(
            offset_s=None if offset_ns is None else offset_ns / NS_PER_S,
            drift_ppm=drift,
            u_drift_ppm=None if self._drift is None else 1e6 * self._drift[1],
            n_faults=n_faults,
        )

    def _was_set(self, arrived: Arrival) -> bool:
        return self._newest is not None and abs(arrived.step_s_since(self._newest)) > _HOST_STEP_S

    def _begin(self, epoch: int, stop_index: int, arrived_s: float) -> None:
        self._epoch, self._origin, self._bin = epoch, (stop_index, arrived_s), -1
        self._bins.clear()
        self._offset_ns.clear()
        self._drift = None


def _slope(points: deque[tuple[float, float]]) -> tuple[float, float] | None:
    """Slope of a straight line and its standard uncertainty, by least squares."""
    if len(points) < _MIN_BINS:
        return None
    host_s, delay_s = np.array(points).T
    host_s -= host_s.mean()
    spread = float(host_s @ host_s)
    slope = float(host_s @ delay_s) / spread
    rest = delay_s - delay_s.mean() - slope * host_s
    return slope, float(np.sqrt(rest @ rest / (len(points) - 2) / spread))


_MAX_SLEW = 200e-6
"""Share by which host stamps may run faster or slower: twice what a poor crystal is off."""

_STEP_NS = NS_PER_S
"""Stamps that are further off than this do not follow a drift: the host's clock was set."""


class HostStamps:
    """Stamps of samples that the device does not stamp: a line through their arrivals.

    It is smooth, always rises and is bent every ten seconds towards the least delay of these by
    changing its slope, never by a jump. Only if the host's clock was set, or the device counts
    anew, does it begin again.

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


_MAX_INTERFACE_DRIFT = 100e-6
"""Of the interface's crystal; what is left of three times that is for the device's."""

_MAX_EARLY_S = 0.5
_MAX_LATE_S = 5.0
"""Frames that have waited for longer than this are taken for those of a clock that was set."""

_MAX_STILL_S = 0.05
"""Frames of one moment are read within this."""


@dataclass(frozen=True)
class _Pair:
    """A stamp and when its frame was read."""

    stamp_s: float
    read: Arrival

    @property
    def difference_s(self) -> float:
        return self.read.steady_s - self.stamp_s


class InterfaceClock:
    """Converts stamps of an interface, whose clock may begin anywhere, to the host's clocks.

    The least difference between reading a frame and its stamp counts as no delay. A stamp that
    runs backwards, repeats or jumps is not used; the moment of reading replaces it. Two in a row
    that fit each other show that the interface's clock has begun anew.
    """

    def __init__(self) -> None:
        self._good: _Pair | None = None
        self._doubted: _Pair | None = None
        self._delay = LeastDelay(_MAX_INTERFACE_DRIFT)

    def arrival(self, stamp_s: float, read: Arrival) -> tuple[Arrival, StampFault | None]:
        """Return when a frame came, and what was wrong with its stamp.

        Parameters
        ----------
        stamp_s
            By the interface.
        read
            When it was read.
        """
        if not math.isfinite(stamp_s) or stamp_s <= 0.0:
            return read, StampFault.REPEATED  # an interface without stamps sends 0
        pair = _Pair(stamp_s, read)
        good, doubted = self._good, self._doubted
        fault = None if good is None else _fault(good, self._delay.least_s or 0.0, pair)
        if fault is not None:
            if doubted is None or _fault(doubted, doubted.difference_s, pair) is not None:
                self._doubted = pair
                return read, fault
            self._delay = LeastDelay(_MAX_INTERFACE_DRIFT)
            self._delay.late_s(doubted.difference_s, read.steady_s)
        self._good, self._doubted = pair, None
        late_s = max(0.0, self._delay.late_s(pair.difference_s, read.steady_s))
        return Arrival(read.host_ns - ns_from_s(late_s), read.steady_s - late_s), None


def _fault(before: _Pair, least_s: float, pair: _Pair) -> StampFault | None:
    if pair.stamp_s < before.stamp_s:
        return StampFault.REGRESSED
    still_s = pair.read.steady_s - before.read.steady_s
    if pair.stamp_s == before.stamp_s and still_s > _MAX_STILL_S:
        return StampFault.REPEATED
    late_s = pair.difference_s - least_s
    return None if -_MAX_EARLY_S <= late_s <= _MAX_LATE_S else StampFault.JUMPED
