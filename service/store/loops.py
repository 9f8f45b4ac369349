"""Background loops of the store: roll-ups, retention, and row checksums."""

import asyncio

from acquisition.clock import Clock
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import LOOK_S, TroubleLog, paced, rest
from service.store.integrity import Integrity
from service.store.port import StoreError
from service.store.retention import Ages, RetentionStore
from service.store.rollups.gathering import RollupStore

RETENTION_PERIOD_S = 600.0
"""Pause of the retention loop when no data are due for deletion."""

RETENTION_REST_SHARE = 9.0
"""Ratio of pause time to working time; the loop uses a tenth of one core."""


class RetentionLoop:
    """Loop that deletes old data in small steps, one bearing after the other, with pauses.

    The age of data is relative to the 24th newest hour with results, or to the clock if the clock
    is earlier. A clock that is set years ahead therefore causes no deletion within the first day.
    """

    def __init__(self, store: RetentionStore, limits: Ages, clock: Clock) -> None:
        self._store, self._limits, self._clock = store, limits, clock
        self._trouble = TroubleLog(
            "old data are not being deleted", "old data are being deleted again"
        )
        self._blocked = TroubleLog(
            "some old data cannot be deleted", "all old data can be deleted again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Delete old data periodically until cancelled; send heartbeats to `pulse`."""
        while True:
            if not await self.round(pulse):
                await rest(RETENTION_PERIOD_S, self._clock, pulse)

    async def round(self, pulse: Pulse = UNHEARD) -> bool:
        """Delete a limited part of the old data of each bearing; return whether any were deleted.

        `pulse` receives heartbeats. Errors of the store are logged; the result is then False.
        """
        found = False
        try:
            believed_ns = await asyncio.to_thread(self._store.believed_ns)
            if believed_ns is None:
                return False
            now_ns = min(self._clock.now_ns(), believed_ns)
            for series in await asyncio.to_thread(self._store.series):
                pulse.beat(LOOK_S)
                async with paced(RETENTION_REST_SHARE, self._clock, pulse):
                    found |= await asyncio.to_thread(
                        self._store.delete, series, self._limits, now_ns
                    )
            found |= await asyncio.to_thread(self._store.prune, self._limits, now_ns)
            found |= await asyncio.to_thread(self._store.give_back)
        except StoreError as error:
            self._trouble.note(str(error))
            return False
        self._trouble.note(None)
        self._blocked.note(self._store.trouble)
        return found


ROLLUP_PERIOD_S = 20.0
"""Pause of the roll-up loop when no readings are due for aggregation."""

ROLLUP_REST_SHARE = 3.0
"""Ratio of pause time to working time; the loop uses at most a quarter of one core."""


class RollupLoop:
    """Loop that aggregates readings into roll-ups, one bearing after the other, with pauses."""

    def __init__(self, rollups: RollupStore, clock: Clock) -> None:
        self._rollups, self._clock = rollups, clock
        self._trouble = TroubleLog(
            "trends are not being aggregated", "trends are being aggregated again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Aggregate readings periodically until cancelled; send heartbeats to `pulse`."""
        while True:
            pulse.beat(ROLLUP_PERIOD_S)
            if not await self._round(pulse):
                await self._clock.sleep(ROLLUP_PERIOD_S)

    async def _round(self, pulse: Pulse) -> bool:
        """Aggregate some new readings of each bearing; return False if there are none."""
        now_ns = self._clock.now_ns()
        with self._trouble.noting(StoreError):
            due = await asyncio.to_thread(self._rollups.due, now_ns)
            for series in due:
                pulse.beat(ROLLUP_PERIOD_S)
                async with paced(ROLLUP_REST_SHARE, self._clock, pulse):
                    await asyncio.to_thread(self._rollups.gather, series, now_ns)
            return bool(due)
        return False


SCRUB_REST_SHARE = 49.0
"""Ratio of pause time to working time; the loop uses a fiftieth of one core."""

MIN_REST_S = 0.2
SCRUB_PERIOD_S = 86_400.0
"""Pause of the scrub loop after all rows have been checked."""


class ScrubLoop:
    """Loop that compares all rows with their checksums, a few rows at a time, with pauses."""

    def __init__(self, integrity: Integrity, clock: Clock) -> None:
        self._integrity, self._clock = integrity, clock
        self._trouble = TroubleLog(
            "stored data are not being checked", "stored data are being checked again"
        )

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Check all rows periodically until cancelled; send heartbeats to `pulse`."""
        while True:
            pulse.beat(LOOK_S)
            if await self.look(pulse):
                await rest(SCRUB_PERIOD_S, self._clock, pulse)

    async def look(self, pulse: Pulse = UNHEARD) -> bool:
        """Check the next rows and pause; return True when a check of all rows is complete.

        `pulse` receives heartbeats. Errors of the store are logged; the result is then False.
        """
        try:
            async with paced(SCRUB_REST_SHARE, self._clock, pulse, MIN_REST_S):
                is_around = await asyncio.to_thread(self._integrity.check_some)
                self._trouble.note(None)
        except StoreError as error:
            self._trouble.note(str(error))
            await self._clock.sleep(LOOK_S)
            return False
        return is_around
