"""Units whose samples or analysis stopped."""

import asyncio
from collections.abc import Collection, Iterable, Mapping, Sequence

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from service.cluster.progress import UnitProgress
from service.live.live_view import LinkState, LiveView
from service.measuring.acquirer import LinkNews
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.analyser import Analyser
from service.measuring.service_alarms import ToldAlarms, gone_alarms, is_shared, judge
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.units import UnitSettings
from service.store.port import StoreError
from service.store.sharing import UnitBeat
from service.store.store import Store

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


log = structlog.get_logger()

MIN_BLOCKS = 3
"""Blocks that are missing in a row; where a sample is a poll, a block may take a minute."""


def silences_s(units: Iterable[UnitSettings], least_s: float) -> dict[str, float]:
    """How long each unit may be silent: by the settings, and as its blocks come."""
    return {
        unit.id: max(least_s, MIN_BLOCKS * unit.block_samples / unit.sampling_hz) for unit in units
    }


class Silence:
    """Counts units as lost of which nothing has come for a while.

    What was known of a unit may say that samples arrive. While the stream has not been reached
    since the start, there is nobody else who could say otherwise.

    Parameters
    ----------
    after_s
        How long each unit may be silent.
    """

    def __init__(
        self, after_s: Mapping[str, float], analyser: Analyser, live: LiveView, clock: Clock
    ) -> None:
        self._after_s, self._clock = after_s, clock
        self._analyser, self._live = analyser, live
        self._since_s = clock.monotonic_s()

    def look(
        self,
        begun: Mapping[str, UnitProgress],
        trouble: str | None,
        waiting: Collection[str] = frozenset(),
    ) -> None:
        """Look at all units once.

        Parameters
        ----------
        begun
            Those whose place on the stream is known.
        trouble
            Why nothing can come, where that is known.
        waiting
            Units of which something has come that was not taken in yet: these are not silent,
            however long the store holds them up.
        """
        for unit, after_s in self._after_s.items():
            if unit in waiting:
                continue
            if unit in begun:
                begun[unit].fall_silent(after_s, trouble)
            elif self._clock.monotonic_s() - self._since_s > after_s:
                self._lose(unit, trouble or "the stream has not been reached yet")

    def _lose(self, unit: str, reason: str) -> None:
        if self._live.status(unit).state is LinkState.NOT_CONNECTED:
            return  # it was said
        self._live.set_link(unit, LinkState.NOT_CONNECTED, reason)
        log.warning("not connected", unit=unit, reason=reason)
        self._analyser.hear(LinkNews(unit, LinkState.NOT_CONNECTED, reason))
