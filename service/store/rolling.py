"""The loop that has trends gathered beforehand, so that a year of them is read at once."""

import asyncio

from acquisition.clock import Clock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, rest_after
from service.store.port import StoreError
from service.store.rollups.port import RollupStore

PERIOD_S = 20.0
"""Between looks, when all is gathered."""

REST_SHARE = 3.0
"""How much longer to rest than to work: gathering an old database takes a quarter of one core."""


class Rolling:
    """Gathers what is due, one bearing after the other, in a thread and with rests in between."""

    def __init__(self, rollups: RollupStore, clock: Clock) -> None:
        self._rollups, self._clock = rollups, clock
        self._trouble = TroubleLog(
            "trends are not being gathered", "trends are being gathered again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Gather for ever."""
        while True:
            pulse.beat(PERIOD_S)
            if not await self._round(pulse):
                await self._clock.sleep(PERIOD_S)

    async def _round(self, pulse: Pulse) -> bool:
        """Gather once for each bearing that is due; returns whether there was any."""
        now_ns = self._clock.now_ns()
        try:
            due = await asyncio.to_thread(self._rollups.due, now_ns)
            for series in due:
                pulse.beat(PERIOD_S)
                begun_s = self._clock.monotonic_s()
                await asyncio.to_thread(self._rollups.gather, series, now_ns)
                taken_s = self._clock.monotonic_s() - begun_s
                await rest_after(taken_s, REST_SHARE, self._clock, pulse)
        except StoreError as error:
            self._trouble.note(str(error))
            return False
        self._trouble.note(None)
        return bool(due)
