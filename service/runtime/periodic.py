"""Shared parts of background loops: logging of failures, and pauses with heartbeats."""

import structlog

from acquisition.clock import Clock
from service.runtime.heartbeats import Pulse

log = structlog.get_logger()

LOOK_S = 20.0
"""Interval of heartbeats during a long pause."""

MOST_REST_S = 120.0
"""Longest pause after one piece of work."""


class TroubleLog:
    """Logs the first failure of a task and its recovery, but not the failures between.

    Parameters
    ----------
    failing, again
        Messages of the first failure and of the recovery.
    """

    def __init__(self, failing: str, again: str) -> None:
        self._failing, self._again = failing, again
        self._trouble: str | None = None

    def note(self, trouble: str | None) -> None:
        """Record the outcome of one run: the reason of its failure, or None."""
        if trouble is not None and self._trouble is None:
            log.error(self._failing, reason=trouble)
        if trouble is None and self._trouble is not None:
            log.info(self._again)
        self._trouble = trouble


async def rest(duration_s: float, clock: Clock, pulse: Pulse) -> None:
    """Pause and send heartbeats meanwhile."""
    until_s = clock.monotonic_s() + duration_s
    while (left_s := until_s - clock.monotonic_s()) > 0.0:
        pulse.beat(LOOK_S)
        await clock.sleep(min(left_s, LOOK_S))


async def rest_after(taken_s: float, share: float, clock: Clock, pulse: Pulse) -> None:
    """Pause for a multiple of the time that the work took, and send heartbeats meanwhile.

    The pause is capped so that one slow disk access does not stall the loop.
    """
    await rest(min(share * taken_s, MOST_REST_S), clock, pulse)
