"""Estimation of sample times and of the device clock from arrival times.

Samples can arrive late, but not early. The smallest observed delay therefore gives the offset
between device clock and host clock, and the delay of each sample is relative to it.
"""

import math
from collections import deque
from dataclasses import dataclass
from itertools import islice

import numpy as np

from acquisition.clock import Clock
from core.samples.blocks import DeviceClock, StampFault
from core.units import NS_PER_S, ns_from_s


@dataclass(frozen=True)
class Arrival:
    """Time of an arrival by both clocks of the host.

    Parameters
    ----------
    host_ns
        Wall clock time, UTC nanoseconds; the clock may be set.
    steady_s
        Monotonic time, seconds.
    """

    host_ns: int
    steady_s: float

    @classmethod
    def now(cls, clock: Clock) -> "Arrival":
        """Return the present time by both clocks."""
        return cls(clock.now_ns(), clock.monotonic_s())

    def step_s_since(self, before: "Arrival") -> float:
        """Return the seconds by which the wall clock was set forward after the arrival `before`."""
        return (self.host_ns - before.host_ns) / NS_PER_S - (self.steady_s - before.steady_s)


_MAX_RISE_S = 1.0
"""Longest elapsed time for which one update increases the stored smallest delay."""


class LeastDelay:
    """Estimator of the smallest transmission delay of samples, which counts as zero lateness.

    The stored minimum increases with time by the largest clock drift.

    Parameters
    ----------
    max_drift
        Largest fraction by which the samples may be slower than the host clock.

    Attributes
    ----------
    least_s
        Smallest delay, seconds; None before the first sample.
    """

    def __init__(self, max_drift: float) -> None:
        self._max_drift = max_drift
        self._at_s = 0.0
        self.least_s: float | None = None

    def late_s(self, delay_s: float, now_s: float) -> float:
        """Add a delay at a monotonic time; return its excess over the previous minimum, seconds."""
        if self.least_s is None:
            self.least_s, self._at_s = delay_s, now_s
        passed_s = min(max(0.0, now_s - self._at_s), _MAX_RISE_S)
        least_s = self.least_s + self._max_drift * passed_s
        self.least_s, self._at_s = min(least_s, delay_s), now_s
        return delay_s - least_s


_BIN_S = 10.0
_MAX_BINS = 360
"""Number of bins of `_BIN_S`, one hour in all: long compared with poll jitter, short compared with
daily temperature changes."""

_MIN_BINS = 6

_Bin = tuple[float, float, int | None]
"""Smallest delay in a bin, with its time, in seconds; and largest clock offset, ns, if known."""

_HOST_STEP_S = 0.5
"""Step of the host clock above which the clock counts as set; synchronisation only slews."""


class ArrivalModel:
    """Estimator of the device clock: offset from wall clock time, drift from monotonic time.

    Of every ten seconds, only the block with the smallest delay is used. The slope of a regression
    line through these blocks is the drift; the residuals give its uncertainty. If the host clock is
    set, estimation restarts: the offset has changed, and monotonic time stops during suspend.

    `rate_hz` is the nominal sampling rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._bins: deque[_Bin] = deque(maxlen=_MAX_BINS)
        self._epoch: int | None = None
        self._origin: tuple[int, float] = (0, 0.0)
        self._newest: Arrival | None = None
        self._bin = -1
        self._drift_ppm: tuple[float, float] | None = None

    def add(self, epoch: int, stop_index: int, stop_ns: int | None, arrived: Arrival) -> None:
        """Add the arrival of all samples before `stop_index`.

        `stop_ns` is the time of `stop_index` by the device stamps; None without device stamps.
        """
        before = self._newest
        was_set = before is not None and abs(arrived.step_s_since(before)) > _HOST_STEP_S
        if epoch != self._epoch or was_set:
            self._epoch, self._origin, self._bin = epoch, (stop_index, arrived.steady_s), -1
            self._bins.clear()
            self._drift_ppm = None
        self._newest = arrived
        host_s = arrived.steady_s - self._origin[1]
        delay_s = host_s - (stop_index - self._origin[0]) / self._rate_hz
        number = int(host_s // _BIN_S)
        offset_ns = None if stop_ns is None else stop_ns - arrived.host_ns
        if number != self._bin:
            self._drift_ppm = _drift_ppm(self._bins)
            self._bin = number
            self._bins.append((host_s, delay_s, offset_ns))
        else:
            bin_ = self._bins[-1]
            offsets_ns = [ns for ns in (bin_[2], offset_ns) if ns is not None]
            host_s, delay_s, _ = min(bin_, (host_s, delay_s, None), key=lambda each: each[1])
            self._bins[-1] = (host_s, delay_s, max(offsets_ns, default=None))

    def device_clock(self, n_faults: int = 0) -> DeviceClock:
        """Return the present offset and drift of the device clock; unknown fields are None.

        `n_faults` is the number of faults of the device's time stamps, for the result.
        """
        offsets_ns = (bin_[2] for bin_ in reversed(self._bins) if bin_[2] is not None)
        offset_ns = max(islice(offsets_ns, _MIN_BINS), default=None)
        offset_s = None if offset_ns is None else offset_ns / NS_PER_S
        drift_ppm, u_drift_ppm = self._drift_ppm or (None, None)
        return DeviceClock(offset_s, drift_ppm, u_drift_ppm, n_faults)


def _drift_ppm(bins: deque[_Bin]) -> tuple[float, float] | None:
    """Return the drift by least squares and its standard uncertainty; None with few points."""
    if len(bins) < _MIN_BINS:
        return None
    host_s, delay_s = np.array([(host_s, delay_s) for host_s, delay_s, _ in bins]).T
    host_s -= host_s.mean()
    spread = float(host_s @ host_s)
    slope = float(host_s @ delay_s) / spread
    rest = delay_s - delay_s.mean() - slope * host_s
    return -1e6 * slope, 1e6 * float(np.sqrt(rest @ rest / (len(bins) - 2) / spread))


_MAX_SLEW = 200e-6
"""Largest relative rate change of host stamps: twice the error of a poor crystal."""

_STEP_NS = NS_PER_S
"""Error of a host stamp that drift cannot explain: above it, the host clock was set."""


class HostStamps:
    """Host time stamps for devices without time stamps, on a line fitted to the arrival times.

    The line is continuous and always increases. Every ten seconds, its slope is adjusted towards
    the smallest delay in these ten seconds. The line restarts only if the host clock was set or a
    new epoch began.

    `rate_hz` is the nominal sampling rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._bin_samples = round(_BIN_S * rate_hz)
        self._epoch: int | None = None
        self._index = 0
        self._ns = 0
        self._slope = 1.0
        self._least_delay_ns = math.inf

    def add(self, epoch: int, stop_index: int, arrived_ns: int) -> None:
        """Add the arrival of the samples before `stop_index`, at `arrived_ns` (ns since 1970 UTC).

        `epoch` is the epoch of the sample count. The result of `start_ns` is undefined before the
        first call.
        """
        delay_ns = arrived_ns - self.start_ns(stop_index)
        if epoch != self._epoch or delay_ns < -_STEP_NS:
            self._lay(epoch, stop_index, arrived_ns)
            return
        self._least_delay_ns = min(self._least_delay_ns, delay_ns)
        if stop_index - self._index < self._bin_samples:
            return
        if self._least_delay_ns > _STEP_NS:
            self._lay(epoch, stop_index, arrived_ns)
        else:
            share = self._least_delay_ns / (_BIN_S * NS_PER_S)
            slope = 1.0 + min(max(share, -_MAX_SLEW), _MAX_SLEW)
            self._lay(epoch, stop_index, self.start_ns(stop_index), slope)

    def start_ns(self, index: int) -> int:
        """Return the time of a sample, UTC ns since 1970; it increases within an epoch."""
        return self._ns + round((index - self._index) * self._period_ns * self._slope)

    def _lay(self, epoch: int, index: int, at_ns: int, slope: float = 1.0) -> None:
        """Begin a straight piece of the line at the time of a sample index."""
        self._epoch, self._slope = epoch, slope
        self._index, self._ns, self._least_delay_ns = index, at_ns, math.inf


_MAX_INTERFACE_DRIFT = 100e-6
"""Largest relative drift of the interface clock; the rest of a total of three times this value is
allowed for the device clock."""

_MAX_EARLY_S = 0.5
_MAX_LATE_S = 5.0
"""Delay of a frame above which the interface clock counts as set."""

_MAX_STILL_S = 0.05
"""Longest time between the reading of two frames that may have the same stamp."""


_Pair = tuple[float, float]
"""Interface stamp of a frame, and monotonic time when the frame was read, seconds."""


class InterfaceClock:
    """Converter of the stamps of a CAN interface, which start at any value, to host time.

    The smallest difference between reading time and stamp counts as zero delay. A stamp that
    regresses, repeats or jumps is replaced by the reading time. Two consecutive such stamps that
    are consistent with each other indicate a restart of the interface clock.
    """

    def __init__(self) -> None:
        self._good: _Pair | None = None
        self._doubted: _Pair | None = None
        self._delay = LeastDelay(_MAX_INTERFACE_DRIFT)

    def arrival(self, stamp_s: float, read: Arrival) -> tuple[Arrival, StampFault | None]:
        """Return the arrival time of a frame, and the fault of its stamp or None.

        The frame also updates the estimated delay; pass each frame once, in order of arrival.

        Parameters
        ----------
        stamp_s
            Stamp of the interface, seconds; 0 from an interface without stamps.
        read
            Time when the frame was read; the result if the stamp has a fault.
        """
        if not math.isfinite(stamp_s) or stamp_s <= 0.0:
            return read, StampFault.REPEATED  # an interface without stamps sends 0
        pair, good, doubted = (stamp_s, read.steady_s), self._good, self._doubted
        fault = None if good is None else _fault(good, self._delay.least_s or 0.0, pair)
        if fault is not None:
            if doubted is None or _fault(doubted, doubted[1] - doubted[0], pair) is not None:
                self._doubted = pair
                return read, fault
            self._delay = LeastDelay(_MAX_INTERFACE_DRIFT)
            self._delay.late_s(doubted[1] - doubted[0], read.steady_s)
        self._good, self._doubted = pair, None
        late_s = max(0.0, self._delay.late_s(read.steady_s - stamp_s, read.steady_s))
        return Arrival(read.host_ns - ns_from_s(late_s), read.steady_s - late_s), None


def _fault(before: _Pair, least_s: float, pair: _Pair) -> StampFault | None:
    (stamp_s, read_s), (before_stamp_s, before_read_s) = pair, before
    if stamp_s < before_stamp_s:
        return StampFault.REGRESSED
    if stamp_s == before_stamp_s and read_s - before_read_s > _MAX_STILL_S:
        return StampFault.REPEATED
    is_near = -_MAX_EARLY_S <= read_s - stamp_s - least_s <= _MAX_LATE_S
    return None if is_near else StampFault.JUMPED
