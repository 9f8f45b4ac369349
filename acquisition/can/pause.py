"""`PauseCheck`: whether samples that follow each other by their counter also do by the clock."""

from acquisition.can.uncounted import MAX_UNSURE_NS, ArrivalCheck
from core.units import NS_PER_S

_MAX_LATE_NS = NS_PER_S // 2
"""As far as the host's clock and a counter may disagree about a jump (`counter_axis`)."""

_MAX_SLOW = 0.05
"""A device that samples ever later, by less than this share, has a wrong rate and no pause."""


class PauseCheck:
    """Finds a device that stopped sampling, and its counter with it.

    Samples that were merely held up on their way are followed, within a second, by others that
    were not. Those that a device took later are not.
    """

    def __init__(self, rate_hz: float, samples_per_frame: int) -> None:
        self._rate_hz, self._samples_per_frame = rate_hz, samples_per_frame
        self.begin()

    def begin(self) -> None:
        """Forget what came before, as when the device begins to count anew."""
        self._check = ArrivalCheck(self._rate_hz, self._samples_per_frame, _MAX_SLOW)
        self._late_since_ns: int | None = None

    @property
    def is_unsure(self) -> bool:
        """Whether the newest samples are late, and it is not known yet why."""
        return self._late_since_ns is not None

    def has_paused(self, stop_index: int, arrived_ns: int) -> bool:
        """Take samples up to an index in; return whether the device paused before the late ones."""
        if self._check.delay_ns(stop_index, arrived_ns) < _MAX_LATE_NS:
            self._late_since_ns = None
            return False
        if self._late_since_ns is None:
            self._late_since_ns = arrived_ns
        if arrived_ns - self._late_since_ns <= MAX_UNSURE_NS:
            return False
        self.begin()
        return True
