"""`Feed`: reads, twice a second, what the processes that analyse have written down."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from core.baseline.baseline import BearingBaseline
from service.cluster.replica.alarms import ReplicaAlarms
from service.cluster.replica.films import ReplicaFilms
from service.cluster.replica.live import ReplicaLive
from service.live.unit_state import (
    UnitSigns,
    UnitState,
    UnreadableStateError,
    read_signs,
    unpacked_state,
)
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.port import Store, StoreError
from service.store.unit_states_port import UnitBeat

log = structlog.get_logger()

EVERY_S = 0.5

Revision = tuple[str, int]
"""Process, and number of the state that it has written."""


@dataclass(frozen=True)
class Report:
    """What was read of one unit.

    Parameters
    ----------
    state
        With its revision and the baselines in force; None where it is as it was.
    """

    beat: UnitBeat
    signs: UnitSigns
    state: tuple[Revision, UnitState, Mapping[str, BearingBaseline]] | None


class Feed:
    """Brings live view, alarms and films of a replica up to what is written down."""

    def __init__(
        self,
        store: Store,
        live: ReplicaLive,
        alarms: ReplicaAlarms,
        films: ReplicaFilms,
        clock: Clock,
    ) -> None:
        self._store, self._clock = store, clock
        self._live, self._alarms, self._films = live, alarms, films
        self._revisions: dict[str, Revision] = {}
        self._unreadable: str | None = None

    async def start(self) -> None:
        """Know what there is before anybody asks.

        Raises
        ------
        StoreError
            If it cannot be read.
        """
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        self._take(await asyncio.to_thread(self._read))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Read for ever."""
        while True:
            pulse.beat(EVERY_S)
            await self.look()
            await self._clock.sleep(EVERY_S)

    async def look(self) -> None:
        """Read once; where that fails everything grows old, and is shown so."""
        try:
            reports = await asyncio.to_thread(self._read)
        except StoreError as error:
            if self._live.read_error is None:
                log.error("units cannot be read", reason=str(error))
            self._live.read_error = str(error)
            return
        if self._live.read_error is not None:
            log.info("units can be read again")
        self._live.read_error = None
        self._take(reports)

    def _read(self) -> list[Report]:
        states = self._store.unit_states
        beats = [beat for beat in states.beats() if beat.unit in self._live.units]
        new = [b.unit for b in beats if self._revisions.get(b.unit) != (b.process, b.revision)]
        documents = states.states(new) if new else {}
        found = (self._report(beat, documents.get(beat.unit)) for beat in beats)
        return [report for report in found if report is not None]

    def _report(self, beat: UnitBeat, document: tuple[str, int, bytes] | None) -> Report | None:
        """What can be made of a report; nothing if it is not to be understood."""
        try:
            signs = read_signs(beat.signs)
            if document is None:
                return Report(beat, signs, None)
            process, revision, content = document
            state = unpacked_state(content)
        except UnreadableStateError as error:
            self._note(beat.unit, str(error))
            return None
        baselines = self._films.fetch(beat.unit, state)
        return Report(beat, signs, ((process, revision), state, baselines))

    def _take(self, reports: Sequence[Report]) -> None:
        for report in reports:
            unit = report.beat.unit
            if report.state is not None:
                self._revisions[unit], state, baselines = report.state
                self._live.set_results(unit, state.bearings)
                self._alarms.take(unit, state)
                self._films.take(unit, state, baselines)
            self._live.hear(unit, report.beat.process, report.beat.n_beats, report.signs)

    def _note(self, unit: str, trouble: str) -> None:
        """Log once what cannot be understood; the unit then counts as silent."""
        if trouble != self._unreadable:
            log.error("a report is of another version, or damaged", unit=unit, reason=trouble)
        self._unreadable = trouble
