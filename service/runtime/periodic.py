"""Parts of background loops: repetition, logging of failures, pauses with heartbeats."""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

import structlog

from acquisition.clock import Clock
from service.runtime.heartbeats import Pulse

log = structlog.get_logger()

LOOK_S = 20.0
"""Maximum interval between heartbeats during a sleep in `rest`."""

MAX_REST_S = 120.0
"""Maximum pause of `paced`."""


class TroubleLog:
    """Log of the first failure of a task and of its recovery; repeated failures are not logged.

    Parameters
    ----------
    failing, again
        Log messages of the first failure and of the recovery.
    trouble
        Reason of the newest failure; None after a success.
    """

    def __init__(self, failing: str, again: str, trouble: str | None = None) -> None:
        self._failing, self._again = failing, again
        self._is_failing = False
        self.trouble = trouble

    def note(self, trouble: str | None) -> None:
        """Record the outcome of one run: the reason of its failure, or None for success."""
        if trouble is not None and not self._is_failing:
            log.error(self._failing, reason=trouble)
        if trouble is None and self.trouble is not None:
            log.info(self._again)
        self.trouble, self._is_failing = trouble, trouble is not None

    @contextmanager
    def noting(self, error: type[Exception]) -> Iterator[None]:
        """Return a context manager that records its outcome; an `error` is recorded, not raised."""
        try:
            yield
        except error as failure:
            self.note(str(failure))
        else:
            self.note(None)


async def periodic(
    work: Callable[[], Awaitable[None]], every_s: float, clock: Clock, pulse: Pulse
) -> None:
    """Repeat `work` until it raises, with a heartbeat before and a pause of `every_s` after it."""
    while True:
        pulse.beat(every_s)
        await work()
        await clock.sleep(every_s)


async def rest(duration_s: float, clock: Clock, pulse: Pulse) -> None:
    """Sleep for `duration_s`, and send heartbeats to `pulse` during the sleep."""
    until_s = clock.monotonic_s() + duration_s
    while (left_s := until_s - clock.monotonic_s()) > 0.0:
        pulse.beat(LOOK_S)
        await clock.sleep(min(left_s, LOOK_S))


@asynccontextmanager
async def paced(
    share: float, clock: Clock, pulse: Pulse, min_rest_s: float = 0.0
) -> AsyncIterator[None]:
    """Return a context manager that sleeps after its block, and sends heartbeats.

    The sleep takes `share` times as long as the block, at least `min_rest_s`, and at most
    `MAX_REST_S`, so that one slow disk access does not stall the loop. After an error in the block
    there is no sleep.
    """
    begun_s = clock.monotonic_s()
    yield
    taken_s = clock.monotonic_s() - begun_s
    await rest(min(max(share * taken_s, min_rest_s), MAX_REST_S), clock, pulse)
