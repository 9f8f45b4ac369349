"""The loop that has every stored row looked at in turn, so that no damage waits to be met."""

import asyncio

from acquisition.clock import Clock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import LOOK_S, TroubleLog, rest, rest_after
from service.store.integrity_port import Integrity
from service.store.port import StoreError

REST_SHARE = 49.0
"""How much longer to rest than to look: it takes a fiftieth of one core."""

LEAST_REST_S = 0.2
PERIOD_S = 86_400.0
"""From once around to the next."""


class Scrubbing:
    """Looks for damage, a little at a time, in a thread and with rests in between."""

    def __init__(self, integrity: Integrity, clock: Clock) -> None:
        self._integrity, self._clock = integrity, clock
        self._trouble = TroubleLog(
            "stored data are not being checked", "stored data are being checked again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            pulse.beat(LOOK_S)
            if await self.look(pulse):
                await rest(PERIOD_S, self._clock, pulse)

    async def look(self, pulse: Pulse = UNHEARD) -> bool:
        """Look at some rows and rest; whether that was once around."""
        begun_s = self._clock.monotonic_s()
        try:
            is_around = await asyncio.to_thread(self._integrity.look_on)
        except StoreError as error:
            self._trouble.note(str(error))
            await self._clock.sleep(LOOK_S)
            return False
        self._trouble.note(None)
        taken_s = self._clock.monotonic_s() - begun_s
        await rest_after(max(LEAST_REST_S / REST_SHARE, taken_s), REST_SHARE, self._clock, pulse)
        return is_around
