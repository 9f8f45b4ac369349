"""`InterfaceClock`: when frames came by the stamps of the interface, on the host's clocks."""

import math
from dataclasses import dataclass

from acquisition.delivery.arrival import Arrival
from core.samples.device_clock import StampFault
from core.units import ns_from_s

_MAX_DRIFT = 100e-6
"""Of the interface's crystal; what is left of three times that is for the device's."""

_MAX_CREEP_S = 1.0
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
    """Leads the stamps of an interface, whose clock may begin anywhere, to the host's clocks.

    Frames can be read late, never early: the least difference between reading and stamp counts,
    and may grow as fast as crystals drift. A stamp that runs backwards, repeats or jumps is not
    used; the moment of reading stands for it. Two in a row that fit each other show that the
    interface's clock has begun anew.
    """

    def __init__(self) -> None:
        self._good: _Pair | None = None
        self._doubted: _Pair | None = None
        self._least_s = 0.0

    def arrival(self, stamp_s: float, read: Arrival) -> tuple[Arrival, StampFault | None]:
        """When a frame came, and what was wrong with its stamp.

        Parameters
        ----------
        stamp_s
            By the interface.
        read
            When it was read.
        """
        if not math.isfinite(stamp_s) or stamp_s <= 0.0:
            return read, StampFault.REPEATED  # an interface without stamps says 0 for ever
        pair = _Pair(stamp_s, read)
        good, doubted = self._good, self._doubted
        if good is None:
            return self._begun(pair, pair), None
        creep_s = _MAX_DRIFT * min(read.steady_s - good.read.steady_s, _MAX_CREEP_S)
        fault = _fault(good, self._least_s, pair)
        if fault is None:
            self._least_s = min(self._least_s + creep_s, pair.difference_s)
            return self._believed(pair), None
        if doubted is not None and _fault(doubted, doubted.difference_s, pair) is None:
            return self._begun(doubted, pair), None
        self._doubted = pair
        return read, fault

    def _begun(self, first: _Pair, second: _Pair) -> Arrival:
        self._least_s = min(first.difference_s, second.difference_s)
        return self._believed(second)

    def _believed(self, pair: _Pair) -> Arrival:
        self._good, self._doubted = pair, None
        late_s = pair.difference_s - self._least_s
        read = pair.read
        return Arrival(read.host_ns - ns_from_s(late_s), read.steady_s - late_s)


def _fault(before: _Pair, least_s: float, pair: _Pair) -> StampFault | None:
    if pair.stamp_s < before.stamp_s:
        return StampFault.REGRESSED
    still_s = pair.read.steady_s - before.read.steady_s
    if pair.stamp_s == before.stamp_s and still_s > _MAX_STILL_S:
        return StampFault.REPEATED
    late_s = pair.difference_s - least_s
    return None if -_MAX_EARLY_S <= late_s <= _MAX_LATE_S else StampFault.JUMPED
