"""The loop that lets what is old become coarser, and gives its room back."""

import asyncio

from acquisition.clock import Clock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import LOOK_S, TroubleLog, rest, rest_after
from service.store.port import StoreError
from service.store.retention.limits import RetentionLimits
from service.store.retention.port import RetentionStore

PERIOD_S = 600.0
"""Between looks, when nothing is old any more."""

REST_SHARE = 9.0
"""How much longer to rest than to work: it takes a tenth of one core, and lets others write."""


class Retaining:
    """Deletes what is old, a little of each bearing in turn, in a thread and with rests between.

    Ages are counted from a moment that a day of results lies behind: a clock that is set years
    ahead makes nothing old before it was believed for a day, though results are stamped by it.
    """

    def __init__(self, store: RetentionStore, limits: RetentionLimits, clock: Clock) -> None:
        self._store, self._limits, self._clock = store, limits, clock
        self._trouble = TroubleLog(
            "what is old is not being deleted", "what is old is being deleted again"
        )
        self._held_up = TroubleLog(
            "some of what is old cannot be deleted", "all of what is old can be deleted again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Delete for ever."""
        while True:
            if not await self.round(pulse):
                await rest(PERIOD_S, self._clock, pulse)

    async def round(self, pulse: Pulse = UNHEARD) -> bool:
        """Delete once of each bearing; whether there was anything to delete."""
        found = False
        try:
            believed_ns = await asyncio.to_thread(self._store.believed_ns)
            if believed_ns is None:
                return False
            now_ns = min(self._clock.now_ns(), believed_ns)
            for series in await asyncio.to_thread(self._store.series):
                pulse.beat(LOOK_S)
                found |= await self._rested(series, now_ns, pulse)
            found |= await asyncio.to_thread(self._store.prune, self._limits, now_ns)
            found |= await asyncio.to_thread(self._store.give_back)
        except StoreError as error:
            self._trouble.note(str(error))
            return False
        self._trouble.note(None)
        self._held_up.note(self._store.trouble)
        return found

    async def _rested(self, series: int, now_ns: int, pulse: Pulse) -> bool:
        begun_s = self._clock.monotonic_s()
        found = await asyncio.to_thread(self._store.delete, series, self._limits, now_ns)
        taken_s = self._clock.monotonic_s() - begun_s
        await rest_after(taken_s, REST_SHARE, self._clock, pulse)
        return found
