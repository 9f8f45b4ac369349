"""State of units, reported through the database and read from it."""

import asyncio
import os
import socket
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from uuid import uuid4

import structlog

from acquisition.clock import Clock
from core.baseline.baseline import BearingBaseline
from core.machine.unit import Unit
from service.cluster.replica_state import ReplicaAlarms, ReplicaFilms, ReplicaLive
from service.live.live_view import LiveView
from service.live.unit_state import (
    UnitSigns,
    UnitState,
    UnreadableStateError,
    packed_state,
    read_signs,
    unpacked_state,
    written_signs,
)
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.describing import alarm_state, plant_signs, unit_signs, unit_state
from service.measuring.films import FilmKeeper
from service.measuring.service_alarms import SHARED, is_shared, told_by
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog
from service.settings.units import UnitSettings
from service.store.port import StoreError
from service.store.sharing import UnitBeat, UnitReport, UnitStates
from service.store.store import Store

EVERY_S = 1.0


@dataclass(frozen=True)
class Seen:
    """A unit at one moment.

    Parameters
    ----------
    state
        None where it is as it was when it was last written.
    """

    unit: str
    signs: UnitSigns
    revision: int
    state: UnitState | None


class Reporter:
    """Looks at the units on the event loop, and writes in a thread.

    Parameters
    ----------
    held
        Which units are this process's just now; with `PLANT` where it also tells of alarms that
        are of no unit, and `SHARED` where it does the shared work.
    """

    def __init__(
        self,
        process: str,
        units: Iterable[UnitSettings],
        held: Callable[[], Iterable[str]],
        live: LiveView,
        alarms: AlarmEngine,
        films: FilmKeeper,
        store: UnitStates,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._store, self._clock = process, held, store, clock
        self._units = {unit.id: unit for unit in units}
        self._live, self._alarms, self._films = live, alarms, films
        self._written: dict[str, tuple[int, UnitState | None]] = {}
        self._n_beats = 0
        self._trouble = TroubleLog("units are not reported on", "units are reported on again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Report for ever."""
        while True:
            pulse.beat(EVERY_S)
            await self.report()
            await self._clock.sleep(EVERY_S)

    async def report(self) -> None:
        """Report once; where that fails, whoever reads will say that nothing is heard."""
        held = list(self._held())
        self._forget_but(held)
        seen = [self._look(unit) for unit in held]
        if not seen:
            return
        self._n_beats += 1
        try:
            await asyncio.to_thread(self._write, seen)
        except StoreError as error:
            self._trouble.note(str(error))
            # it may have been written all the same: no other state ever gets its number
            self._written |= {s.unit: (s.revision, None) for s in seen if s.state is not None}
            return
        self._trouble.note(None)
        self._written |= {s.unit: (s.revision, s.state) for s in seen if s.state is not None}

    def _forget_but(self, held: Sequence[str]) -> None:
        """Write anew, under further numbers, what others may write of meanwhile."""
        for unit in self._written.keys() - set(held):
            self._written[unit] = (self._written[unit][0], None)

    def _look(self, unit: str) -> Seen:
        said_s = self._clock.monotonic_s()
        state, signs = self._state_of(unit)
        signs = replace(signs, said_s=said_s)
        revision, written = self._written.get(unit, (0, None))
        if state == written:
            return Seen(unit, signs, revision, None)
        return Seen(unit, signs, revision + 1, state)

    def _state_of(self, unit: str) -> tuple[UnitState, UnitSigns]:
        settings = self._units.get(unit)
        if settings is not None:
            state = unit_state(settings, self._live, self._alarms, self._films)
            return state, unit_signs(settings, self._live)
        others = [
            alarm
            for alarm in self._alarms.alarms
            if told_by(alarm.identity) not in self._units and is_shared(alarm) == (unit == SHARED)
        ]
        return alarm_state(others, self._alarms), plant_signs(self._live)

    def _write(self, seen: Sequence[Seen]) -> None:
        self._store.report(self._process, [self._report(each) for each in seen])

    def _report(self, seen: Seen) -> UnitReport:
        status = seen.signs.status
        return UnitReport(
            unit=seen.unit,
            n_beats=self._n_beats,
            beat_ns=self._clock.now_ns(),
            link=status.state.value,
            reason=status.reason,
            last_sample_ns=status.last_sample_ns,
            signs=written_signs(seen.signs),
            revision=seen.revision,
            state=None if seen.state is None else packed_state(seen.state),
        )


log = structlog.get_logger()

LOOK_S = 0.5

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
            pulse.beat(LOOK_S)
            await self.look()
            await self._clock.sleep(LOOK_S)

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


def process_name() -> str:
    """Host, number and a word that no other start has had."""
    return f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:12]}"


class Described:
    """Stands where there is no monitor: references change what is said of a unit."""

    def __init__(self, unit: Unit) -> None:
        self.unit = unit

    def replace_description(self, unit: Unit) -> None:
        """Take a new description of the same unit."""
        self.unit = unit
