"""Detection of units whose analysis reports or stream messages have stopped."""

import asyncio
from collections.abc import Collection, Iterable, Mapping, Sequence

import structlog

from acquisition.clock import Clock
from core.alarms.kinds import Watch
from core.limits import WITHIN, AlarmLevel, Judgement
from service.cluster.progress import UnitProgress, take_news
from service.live.alarm_list import is_shared
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.analyser import Analyser
from service.measuring.live_view import LiveView
from service.measuring.service_alarms import AT_ONCE, ReportedAlarms, identity_of
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import periodic
from service.settings.units import UnitSettings
from service.store.port import StoreError
from service.store.store import Store

SILENT_AFTER_S = 30.0
"""Time without reports after which a unit counts as silent, s. A takeover by a standby process
takes a few seconds, a restart up to ten seconds."""

EVERY_S = 1.0


class SilentUnits:
    """Monitor, in the leader only, that raises alarms about units whose reports have stopped.

    Ages are measured by the monotonic clock of this process from the arrival of a report, so that
    the clocks of the hosts need not agree. Time in which the database cannot be read is excluded.
    """

    def __init__(
        self, units: Sequence[str], alarms: AlarmEngine, store: Store, clock: Clock
    ) -> None:
        self._units, self._alarms = list(units), alarms
        self._store, self._clock = store, clock
        self._beats: dict[str, tuple[str, int]] = {}
        self._seen_s: dict[str, float] = {}
        self._since_s = 0.0
        self._board: ReportedAlarms | None = None

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Check the reports of all units periodically; `pulse` receives heartbeats.

        When the task is cancelled, the alarms about silent units are removed.
        """
        try:
            await periodic(self.look, EVERY_S, self._clock, pulse)
        finally:
            self.leave()

    async def look(self) -> None:
        """Read the reports of all units once, and update the alarms about silent units."""
        try:
            if self._board is None:
                stored = await asyncio.to_thread(self._store.alarms)
                board = ReportedAlarms(Watch(identity_of(u), AT_ONCE, u) for u in self._units)
                self._alarms.add_alarms(board, [alarm for alarm in stored if is_shared(alarm)])
                self._beats.clear()
                self._seen_s.clear()
                self._since_s, self._board = self._clock.monotonic_s(), board
            beats = await asyncio.to_thread(self._store.unit_states.beats)
        except StoreError:
            self._since_s = self._clock.monotonic_s()
            return
        now_s = self._clock.monotonic_s()
        for beat in beats:
            is_new = self._beats.get(beat.unit) != (beat.process, beat.n_beats)
            # the age of the first report read from a unit is unknown
            if is_new and beat.unit in self._beats and beat.unit in self._units:
                self._seen_s[beat.unit] = now_s
            self._beats[beat.unit] = (beat.process, beat.n_beats)
        waits_s = {u: now_s - max(self._seen_s.get(u, 0.0), self._since_s) for u in self._units}
        reason = f"no report for {SILENT_AFTER_S:g} s; check that `padwatch analyse` is running"
        for unit, wait_s in waits_s.items():
            if wait_s > SILENT_AFTER_S:
                gone = Judgement(AlarmLevel.DANGER, reason=reason)
                self._board.report(identity_of(unit).id, gone)
            elif unit in self._seen_s:
                self._board.report(identity_of(unit).id, WITHIN)

    def leave(self) -> None:
        """Remove the alarms about silent units; the next leader becomes responsible for them."""
        if self._board is not None:
            self._alarms.remove_alarms(self._board)
        self._board = None

    @property
    def is_watching(self) -> bool:
        """Whether this process has read the stored alarms about silent units and updates them."""
        return self._board is not None


log = structlog.get_logger()

MIN_BLOCKS = 3
"""Minimum silence of a unit in durations of a block; a block may last a minute."""


def silences_s(units: Iterable[UnitSettings], least_s: float) -> dict[str, float]:
    """Return the time without blocks after which a unit is not connected, s, by unit id.

    The time is `MIN_BLOCKS` durations of a block, and at least ``least_s`` seconds.
    """
    return {
        unit.id: max(least_s, MIN_BLOCKS * unit.block_samples / unit.sampling_hz) for unit in units
    }


class SilenceWatch:
    """Monitor that marks a unit as not connected if no messages of the unit arrive.

    This includes units that have sent no message since the start of this process.

    Parameters
    ----------
    after_s
        Time without messages after which a unit is marked, s, by unit id.
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
        """Check the time since the last message of every unit once.

        Parameters
        ----------
        begun
            Progress of the units whose position on the stream is known, by unit id.
        trouble
            Reason why no messages can arrive; None if unknown.
        waiting
            Units with fetched messages that wait for the store; these units are not silent.
        """
        for unit, after_s in self._after_s.items():
            if unit in waiting:
                continue
            if unit in begun:
                begun[unit].fall_silent(after_s, trouble)
            elif self._clock.monotonic_s() - self._since_s > after_s:
                reason = trouble or "the stream has not been reached yet"
                news = LinkNews(unit, LinkState.NOT_CONNECTED, reason)
                if self._live.status(unit).state is not LinkState.NOT_CONNECTED:
                    take_news(news, self._live, self._analyser)
