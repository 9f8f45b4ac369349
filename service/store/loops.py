"""Loops of the store: roll-ups, retention, and looking all stored rows through."""

import asyncio

from acquisition.clock import Clock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import LOOK_S, TroubleLog, rest, rest_after
from service.store.integrity import Integrity
from service.store.port import StoreError
from service.store.retention import Ages, RetentionStore
from service.store.rollups.gathering import RollupStore

RETAINING_PERIOD_S = 600.0
"""Between looks, when nothing is old any more."""

RETAINING_REST_SHARE = 9.0
"""How much longer to rest than to work: it takes a tenth of one core, and lets others write."""


class Retaining:
    """Deletes what is old, a little of each bearing in turn, in a thread and with rests between.

    Ages are counted from a moment that a day of results lies behind: a clock that is set years
    ahead makes nothing old before it was believed for a day, though results are stamped by it.
    """

    def __init__(self, store: RetentionStore, limits: Ages, clock: Clock) -> None:
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
                await rest(RETAINING_PERIOD_S, self._clock, pulse)

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
        await rest_after(taken_s, RETAINING_REST_SHARE, self._clock, pulse)
        return found


ROLLING_PERIOD_S = 20.0
"""Between looks, when all is gathered."""

ROLLING_REST_SHARE = 3.0
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
            pulse.beat(ROLLING_PERIOD_S)
            if not await self._round(pulse):
                await self._clock.sleep(ROLLING_PERIOD_S)

    async def _round(self, pulse: Pulse) -> bool:
        """Gather once for each bearing that is due; returns whether there was any."""
        now_ns = self._clock.now_ns()
        try:
            due = await asyncio.to_thread(self._rollups.due, now_ns)
            for series in due:
                pulse.beat(ROLLING_PERIOD_S)
                begun_s = self._clock.monotonic_s()
                await asyncio.to_thread(self._rollups.gather, series, now_ns)
                taken_s = self._clock.monotonic_s() - begun_s
                await rest_after(taken_s, ROLLING_REST_SHARE, self._clock, pulse)
        except StoreError as error:
            self._trouble.note(str(error))
            return False
        self._trouble.note(None)
        return bool(due)


SCRUBBING_REST_SHARE = 49.0
"""How much longer to rest than to look: it takes a fiftieth of one core."""

LEAST_REST_S = 0.2
SCRUBBING_PERIOD_S = 86_400.0
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
                await rest(SCRUBBING_PERIOD_S, self._clock, pulse)

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
        await rest_after(
            max(LEAST_REST_S / SCRUBBING_REST_SHARE, taken_s),
            SCRUBBING_REST_SHARE,
            self._clock,
            pulse,
        )
        return is_around
