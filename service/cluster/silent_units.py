"""`SilentUnits`: sees, in one process of a plant, which units nobody analyses any more."""

import asyncio
from collections.abc import Iterable, Sequence

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.alarms.gone_alarms import gone_alarms, is_shared, judge
from service.measuring.alarms.told_alarms import ToldAlarms
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.port import Store, StoreError
from service.store.unit_states_port import UnitBeat

SILENT_AFTER_S = 30.0
"""A standby takes over within seconds, a restart within ten: what lasts longer, somebody must see
to."""

EVERY_S = 1.0


class SilentUnits:
    """Raises the alarm about a unit whose reports cease, for as long as this process leads.

    Ages are measured by this process's steady clock from the moment at which it saw a report, so
    that hosts' clocks need not agree. While reports cannot be read nothing is judged: who could
    not read could not write, either.

    Parameters
    ----------
    units
        All of the plant, also those that other processes analyse.
    """

    def __init__(
        self, units: Sequence[str], alarms: AlarmEngine, store: Store, clock: Clock
    ) -> None:
        self._units, self._alarms = list(units), alarms
        self._store, self._clock = store, clock
        self._beats: dict[str, tuple[str, int]] = {}
        self._heard_s: dict[str, float] = {}
        self._since_s = 0.0
        self._board: ToldAlarms | None = None

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for as long as this process leads."""
        try:
            while True:
                pulse.beat(EVERY_S)
                await self.look()
                await self._clock.sleep(EVERY_S)
        finally:
            self.leave()

    async def look(self) -> None:
        """Read the reports once, and judge."""
        try:
            if self._board is None:
                self._board = self._kept(await asyncio.to_thread(self._store.alarms))
            beats = await asyncio.to_thread(self._store.unit_states.beats)
        except StoreError:
            self._since_s = self._clock.monotonic_s()
            return
        self._hear(beats)
        now_s = self._clock.monotonic_s()
        waits_s = {u: now_s - max(self._heard_s.get(u, 0.0), self._since_s) for u in self._units}
        silent = [unit for unit, wait_s in waits_s.items() if wait_s > SILENT_AFTER_S]
        heard = [unit for unit in self._heard_s if unit not in silent]
        judge(self._board, silent, heard, SILENT_AFTER_S)

    def leave(self) -> None:
        """Leave the alarms to whoever leads next."""
        if self._board is not None:
            self._alarms.drop(self._board)
        self._board = None

    @property
    def is_watching(self) -> bool:
        """Whether the alarms are this process's just now."""
        return self._board is not None

    def _kept(self, stored: Iterable[Alarm]) -> ToldAlarms:
        """Take the alarms over, and wait anew, whoever was heard before."""
        board = gone_alarms(self._units)
        self._alarms.keep(board, [alarm for alarm in stored if is_shared(alarm)])
        self._beats.clear()
        self._heard_s.clear()
        self._since_s = self._clock.monotonic_s()
        return board

    def _hear(self, beats: Sequence[UnitBeat]) -> None:
        for beat in beats:
            is_new = self._beats.get(beat.unit) != (beat.process, beat.n_beats)
            # nobody knows how old the first one is that is read
            if is_new and beat.unit in self._beats and beat.unit in self._units:
                self._heard_s[beat.unit] = self._clock.monotonic_s()
            self._beats[beat.unit] = (beat.process, beat.n_beats)
