"""What loops in the background share: trouble told once, and rests during which they are heard."""

import structlog

from acquisition.clock import Clock
from service.runtime.heartbeats import Pulse

log = structlog.get_logger()

LOOK_S = 20.0
"""Between heartbeats during a long rest."""

MOST_REST_S = 120.0
"""After one piece of work."""


class TroubleLog:
    """Logs when something begins to fail, and when it ceases to; not each time between.

    Parameters
    ----------
    failing, again
        What is said then.
    """

    def __init__(self, failing: str, again: str) -> None:
        self._failing, self._again = failing, again
        self._trouble: str | None = None

    def note(self, trouble: str | None) -> None:
        """Hear how it went; None if it went well."""
        if trouble is not None and self._trouble is None:
            log.error(self._failing, reason=trouble)
        if trouble is None and self._trouble is not None:
            log.info(self._again)
        self._trouble = trouble


async def rest(duration_s: float, clock: Clock, pulse: Pulse) -> None:
    """Rest, and be heard meanwhile."""
    until_s = clock.monotonic_s() + duration_s
    while (left_s := until_s - clock.monotonic_s()) > 0.0:
        pulse.beat(LOOK_S)
        await clock.sleep(min(left_s, LOOK_S))


async def rest_after(taken_s: float, share: float, clock: Clock, pulse: Pulse) -> None:
    """Rest so many times as long as the work took, and be heard meanwhile.

    A disk that stood still says nothing of how much work it was: the rest is bounded.
    """
    await rest(min(share * taken_s, MOST_REST_S), clock, pulse)
