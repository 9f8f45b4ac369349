"""`HostTime`: the time by which links and the service are judged, where somebody may set clocks."""

import structlog

from acquisition.clock import Clock
from core.units import NS_PER_S

log = structlog.get_logger()

STEP_S = 0.5
"""A clock that is kept right is slewed; one that moves so much at once has been set."""


class HostTime:
    """The host's wall clock, held against its steady one."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._seen: tuple[int, float] | None = None

    def look(self) -> tuple[int, bool]:
        """UTC nanoseconds, and whether the clock has been set since the look before.

        Time that seems to have passed by that must count for no delay.
        """
        now_ns, steady_s = self._clock.now_ns(), self._clock.monotonic_s()
        before, self._seen = self._seen, (now_ns, steady_s)
        if before is None:
            return now_ns, False
        step_s = (now_ns - before[0]) / NS_PER_S - (steady_s - before[1])
        if abs(step_s) <= STEP_S:
            return now_ns, False
        log.warning("the clock of this host was set", by_s=round(step_s, 3))
        return now_ns, True
