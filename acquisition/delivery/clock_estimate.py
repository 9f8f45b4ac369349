"""`ClockEstimate`: a device's clocks against the host's, from when its samples arrive."""

from collections import deque

import numpy as np

from acquisition.delivery.arrival import Arrival
from core.samples.device_clock import DeviceClock
from core.units import NS_PER_S

_BIN_S = 10.0
_MAX_BINS = 360
"""An hour: long against the jitter of polls, short against the day of a crystal's temperature."""

_MIN_BINS = 6

_STEP_S = 0.5
"""A host's clock that is kept right is slewed; one that moves so much at once has been set."""


class ClockEstimate:
    """Offset of stamps by the host's wall clock, and drift of sampling by its steady one.

    Samples can arrive late, never early. Therefore of every ten seconds only the block that came
    with the least delay counts; a line through these gives the drift, its scatter the uncertainty.
    If the host's clock is set, both begin anew: the offset is another one, and a host that was
    suspended has counted no time meanwhile.
    """

    def __init__(self) -> None:
        self._bins: deque[tuple[float, float]] = deque(maxlen=_MAX_BINS)
        self._offset_ns: deque[int] = deque(maxlen=_MAX_BINS)
        self._epoch: int | None = None
        self._origin: tuple[int, float] = (0, 0.0)
        self._newest: Arrival | None = None
        self._bin = -1
        self._drift: tuple[float, float] | None = None

    def add(
        self, epoch: int, stop_index: int, rate_hz: float, stop_ns: int | None, arrived: Arrival
    ) -> None:
        """Note that all samples up to an index had arrived.

        Parameters
        ----------
        stop_ns
            Time of that index by the device's stamps; None if it does not stamp.
        arrived
            The host's clocks.
        """
        if epoch != self._epoch or self._was_set(arrived):
            self._begin(epoch, stop_index, arrived.steady_s)
        self._newest = arrived
        host_s = arrived.steady_s - self._origin[1]
        delay_s = host_s - (stop_index - self._origin[0]) / rate_hz
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

    def reading(self, n_faults: int = 0) -> DeviceClock:
        """What is known now."""
        offset_ns = max(list(self._offset_ns)[-_MIN_BINS:], default=None)
        drift = None if self._drift is None else -1e6 * self._drift[0]
        return DeviceClock(
            offset_s=None if offset_ns is None else offset_ns / NS_PER_S,
            drift_ppm=drift,
            u_drift_ppm=None if self._drift is None else 1e6 * self._drift[1],
            n_faults=n_faults,
        )

    def _was_set(self, arrived: Arrival) -> bool:
        return self._newest is not None and abs(arrived.step_s_since(self._newest)) > _STEP_S

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
