"""`Reporter`: writes down, about every second, what this process knows of its units."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from acquisition.clock import Clock
from service.live.live_view import LiveView
from service.live.unit_state import UnitSigns, UnitState, packed_state, written_signs
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.alarms.gone_alarms import SHARED, is_shared
from service.measuring.alarms.service_rules import told_by
from service.measuring.describing import alarm_state, plant_signs, unit_signs, unit_state
from service.measuring.films.keeper import FilmKeeper
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog
from service.settings.units import UnitSettings
from service.store.port import StoreError
from service.store.unit_states_port import UnitReport, UnitStates

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
