"""Time stamps that fit the sample index, and what to do with those that do not."""

from dataclasses import replace

from acquisition.delivery.raw import RawBlock
from core.samples.axis import ClockTolerance
from core.samples.device_clock import StampFault
from core.units import NS_PER_S, ns_from_s

_TOLERANCE = ClockTolerance()

_POSSIBLE_NS = range(946_684_800 * NS_PER_S, 4_102_444_800 * NS_PER_S)
"""From 2000 to 2100: a clock that leaves it (1904, 1970, 2106) was not set but has failed."""


class StampCheck:
    """Compares each block's stamp with what the sample index says; the index rules.

    A stamp that does not fit is replaced by the one that follows from the last good stamp, and the
    block says what was wrong. Two in a row that agree with each other show that the device's clock
    was set: from then on they are believed, unless they have left the years of 2000 to 2100.

    Attributes
    ----------
    n_faults
        Stamps that were not used.
    """

    def __init__(self) -> None:
        self._good: RawBlock | None = None
        self._doubted: RawBlock | None = None
        self.n_faults = 0

    def check(self, raw: RawBlock) -> tuple[RawBlock, StampFault | None]:
        """Return the block with a stamp that can be used, and what was wrong with its own."""
        good, doubted = self._good, self._doubted
        if good is None or raw.epoch != good.epoch:
            return self._believe(raw), None
        fault = _fault(good, raw)
        was_set = (
            doubted is not None and _fault(doubted, raw) is None and not _has_failed(good, raw)
        )
        if fault is None or was_set:
            return self._believe(raw), None
        self._doubted = raw
        self.n_faults += 1
        return replace(raw, start_ns=good.start_ns + _expected_ns(good, raw)), fault

    def _believe(self, raw: RawBlock) -> RawBlock:
        self._good, self._doubted = raw, None
        return raw


def _expected_ns(before: RawBlock, after: RawBlock) -> int:
    return ns_from_s((after.first_index - before.first_index) / after.rate_hz)


def _has_failed(before: RawBlock, after: RawBlock) -> bool:
    return before.start_ns in _POSSIBLE_NS and after.start_ns not in _POSSIBLE_NS


def _fault(before: RawBlock, after: RawBlock) -> StampFault | None:
    expected_ns = _expected_ns(before, after)
    elapsed_ns = after.start_ns - before.start_ns
    if elapsed_ns == 0 and expected_ns:
        return StampFault.REPEATED
    if elapsed_ns * expected_ns < 0:
        return StampFault.REGRESSED
    if abs(elapsed_ns - expected_ns) > _TOLERANCE.over(expected_ns):
        return StampFault.JUMPED
    return None
