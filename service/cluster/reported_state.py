"""Reports on units, which analysing processes write to the database and replicas read."""

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
from service.measuring.films import FilmMonitor
from service.measuring.reported_alarms import SHARED, is_shared
from service.measuring.service_alarms import reporting_unit
from service.measuring.snapshots import alarm_state, plant_signs, unit_signs, unit_state
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.settings.units import UnitSettings
from service.store.port import StoreError
from service.store.sharing import UnitBeat, UnitReport, UnitStates
from service.store.store import Store

REPORT_EVERY_S = 1.0


@dataclass(frozen=True)
class UnitNow:
    """Content of a report on a unit: its signs (link state, ages) and state (results, alarms).

    Parameters
    ----------
    state
        State to write; None if it is unchanged since the last write.
    """

    unit: str
    signs: UnitSigns
    revision: int
    state: UnitState | None


class Reporter:
    """Writer of reports; it reads unit states on the event loop and writes reports in a thread.

    Parameters
    ----------
    held
        Function that returns the ids of the units that this process is responsible for; also
        `PLANT` if it reports the alarms without a unit, and `SHARED` if it does the shared work.
    """

    def __init__(
        self,
        process: str,
        units: Iterable[UnitSettings],
        held: Callable[[], Iterable[str]],
        live: LiveView,
        alarms: AlarmEngine,
        films: FilmMonitor,
        store: UnitStates,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._store, self._clock = process, held, store, clock
        self._units = {unit.id: unit for unit in units}
        self._live, self._alarms, self._films = live, alarms, films
        self._written: dict[str, tuple[int, UnitState | None]] = {}
        self._n_beats = 0
        self._trouble = TroubleLog("unit states are not reported", "unit states are reported again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write reports periodically, until cancelled."""
        await periodic(self.report, REPORT_EVERY_S, self._clock, pulse)

    async def report(self) -> None:
        """Write one report on each unit; after failed writes, readers treat the units as silent."""
        held = list(self._held())
        for unit in self._written.keys() - set(held):  # another process may now write it
            self._written[unit] = (self._written[unit][0], None)
        found = [self._unit_now(unit) for unit in held]
        if not found:
            return
        self._n_beats += 1
        try:
            await asyncio.to_thread(
                lambda: self._store.report(self._process, [self._report(each) for each in found])
            )
        except StoreError as error:
            self._trouble.note(str(error))
            # the report may have been stored: do not reuse its revision for another state
            self._written |= {s.unit: (s.revision, None) for s in found if s.state is not None}
            return
        self._trouble.note(None)
        self._written |= {s.unit: (s.revision, s.state) for s in found if s.state is not None}

    def _unit_now(self, unit: str) -> UnitNow:
        said_s = self._clock.monotonic_s()
        state, signs = self._state_of(unit)
        signs = replace(signs, said_s=said_s)
        revision, written = self._written.get(unit, (0, None))
        if state == written:
            return UnitNow(unit, signs, revision, None)
        return UnitNow(unit, signs, revision + 1, state)

    def _state_of(self, unit: str) -> tuple[UnitState, UnitSigns]:
        settings = self._units.get(unit)
        if settings is not None:
            state = unit_state(settings, self._live, self._alarms, self._films)
            return state, unit_signs(settings, self._live)
        others = [
            alarm
            for alarm in self._alarms.alarms
            if reporting_unit(alarm.identity) not in self._units
            and is_shared(alarm) == (unit == SHARED)
        ]
        return alarm_state(others, self._alarms), plant_signs(self._live)

    def _report(self, now: UnitNow) -> UnitReport:
        status = now.signs.status
        return UnitReport(
            unit=now.unit,
            n_beats=self._n_beats,
            beat_ns=self._clock.now_ns(),
            link=status.state.value,
            reason=status.reason,
            last_sample_ns=status.last_sample_ns,
            signs=written_signs(now.signs),
            revision=now.revision,
            state=None if now.state is None else packed_state(now.state),
        )


log = structlog.get_logger()

READ_EVERY_S = 0.5

Revision = tuple[str, int]
"""Id of a process, and revision of the unit state that it wrote."""


@dataclass(frozen=True)
class Report:
    """Decoded report on one unit, as read from the database.

    Parameters
    ----------
    state
        Revision, state and baselines in force; None if the revision was read before.
    """

    beat: UnitBeat
    signs: UnitSigns
    state: tuple[Revision, UnitState, Mapping[str, BearingBaseline]] | None


class Feed:
    """Reader of the reports in the database; updates live view, alarms and films of a replica."""

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
        self._trouble = TroubleLog("unit states cannot be read", "unit states can be read again")

    async def start(self) -> None:
        """Read the stored alarms and the reports, before the first request is served.

        Raises `StoreError` if the database cannot be read.
        """
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        self._take(await asyncio.to_thread(self._read))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Read the reports periodically, until cancelled."""
        await periodic(self.look, READ_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Read the reports once; if this fails, the old values remain and their ages increase."""
        try:
            reports = await asyncio.to_thread(self._read)
        except StoreError as error:
            self._live.read_error = str(error)
        else:
            self._live.read_error = None
            self._take(reports)
        self._trouble.note(self._live.read_error)

    def _read(self) -> list[Report]:
        states = self._store.unit_states
        beats = [beat for beat in states.beats() if beat.unit in self._live.units]
        new = [b.unit for b in beats if self._revisions.get(b.unit) != (b.process, b.revision)]
        documents = states.states(new) if new else {}
        found = (self._report(beat, documents.get(beat.unit)) for beat in beats)
        return [report for report in found if report is not None]

    def _report(self, beat: UnitBeat, document: tuple[str, int, bytes] | None) -> Report | None:
        """Decode a report; log an unreadable report once and return None."""
        try:
            signs = read_signs(beat.signs)
            if document is None:
                return Report(beat, signs, None)
            process, revision, content = document
            state = unpacked_state(content)
        except UnreadableStateError as error:
            if str(error) != self._unreadable:
                reason = self._unreadable = str(error)
                log.error("a reported unit state is unreadable", unit=beat.unit, reason=reason)
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
            self._live.update(unit, report.beat.process, report.beat.n_beats, report.signs)


def process_name() -> str:
    """Return a unique name of this process: host name, process id and random hex digits."""
    return f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:12]}"


@dataclass
class UnitDescription:
    """Holder of the description of a unit, for a process without a monitor of the unit.

    A new gap reference replaces the description.
    """

    unit: Unit

    def replace_description(self, unit: Unit) -> None:
        """Replace the description by a new description of the same unit."""
        self.unit = unit
