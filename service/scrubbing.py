"""The loop that has every stored row looked at in turn, so that no damage waits to be met."""

import asyncio

import structlog

from acquisition.clock import Clock
from service.heartbeats import UNHEARD, Pulse
from service.store.integrity_port import Integrity
from service.store.port import StoreError

log = structlog.get_logger()

REST_SHARE = 49.0
"""How much longer to rest than to look: it takes a fiftieth of one core."""

LEAST_REST_S = 0.2
PERIOD_S = 86_400.0
"""From once around to the next."""

LOOK_S = 20.0
"""Between heartbeats meanwhile, and until the next attempt when the store cannot be read."""


class Scrubbing:
    """Looks for damage, a little at a time, in a thread and with rests in between."""

    def __init__(self, integrity: Integrity, clock: Clock) -> None:
        self._integrity, self._clock = integrity, clock
        self._trouble: str | None = None

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            pulse.beat(LOOK_S)
            if await self.look():
                await self._wait(pulse)

    async def look(self) -> bool:
        """Look at some rows and rest; whether that was once around."""
        begun_s = self._clock.monotonic_s()
        try:
            is_around = await asyncio.to_thread(self._integrity.look_on)
        except StoreError as error:
            self._note(str(error))
            await self._clock.sleep(LOOK_S)
            return False
        self._note(None)
        taken_s = self._clock.monotonic_s() - begun_s
        await self._clock.sleep(max(LEAST_REST_S, REST_SHARE * taken_s))
        return is_around

    async def _wait(self, pulse: Pulse) -> None:
        until_s = self._clock.monotonic_s() + PERIOD_S
        while self._clock.monotonic_s() < until_s:
            pulse.beat(LOOK_S)
            await self._clock.sleep(LOOK_S)

    def _note(self, trouble: str | None) -> None:
        """Log when looking begins or ceases to fail."""
        if trouble is not None and self._trouble is None:
            log.error("stored data are not being checked", reason=trouble)
        if trouble is None and self._trouble is not None:
            log.info("stored data are being checked again")
        self._trouble = trouble
