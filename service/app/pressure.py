"""`Pressure`: whether there is something more urgent than to record."""

from collections.abc import Callable

from service.measuring.acquirer import Bus
from service.recordings.continuous_recorder import Shed

BEHIND_S = 3.0
"""Blocks that wait this long for the analysis put off recording; results come first."""

BEHIND_SHARE = 0.25
"""So does a queue that is filled this far."""

CAUGHT_UP = 1.0 / 3.0
"""Share of these limits below which recording goes on."""


class Pressure:
    """Looks at the queue to the analysis and at the disk; waveforms give way to both.

    Parameters
    ----------
    is_full
        Whether the disk is nearly full.
    has_shed
        Whether questions are refused already: these go before waveforms do.
    """

    def __init__(
        self,
        bus: Bus,
        is_full: Callable[[], bool] = lambda: False,
        has_shed: Callable[[], bool] = lambda: True,
    ) -> None:
        self._bus, self._is_full, self._has_shed = bus, is_full, has_shed
        self._is_behind = False

    def look(self) -> Shed | None:
        """Why nothing is to be recorded now; None if nothing is in the way."""
        share = CAUGHT_UP if self._is_behind else 1.0
        is_behind = (
            self._bus.oldest_wait_s > share * BEHIND_S
            or self._bus.depth > share * BEHIND_SHARE * self._bus.capacity
        )
        self._is_behind = is_behind and (self._is_behind or self._has_shed())
        if self._is_behind:
            return Shed.ANALYSIS_BEHIND
        return Shed.DISK_FULL if self._is_full() else None
