"""`LiveClient`: present state of the plant in the serving process."""

from dataclasses import replace

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from service.live.alarm_list import LiveAlarms
from service.live.current_state import Ask, LiveFilms, LiveUnits
from service.live.snapshot import PlantSnapshot, Report
from service.settings.core_values import chatter_rule_of, stale_after_s
from service.settings.plant import PlantFile
from service.store.films import FilmStore


class LiveClient:
    """Present state of all units, alarms and films, from the reports of measuring processes.

    Baselines in force are read from the store `films`. `ask` is a coroutine function that sends a
    question to the measuring process and returns the answer; its arguments are the kind of question
    and a JSON document. None if this process has no connection to the measuring process.
    """

    def __init__(
        self, plant: PlantFile, films: FilmStore, clock: Clock, ask: Ask | None = None
    ) -> None:
        units = [unit.id for unit in plant.unit]
        self.units = LiveUnits(units, clock, stale_after_s(plant), ask)
        self.alarms = LiveAlarms(units, self.units.is_alive, chatter_rule_of(plant.alarms))
        self.films = LiveFilms(plant, films)
        self._plant = PlantSnapshot()

    @property
    def plant(self) -> PlantSnapshot:
        """Newest state of the measuring process; without reports, its loops count as stuck."""
        silence_s = self.units.silence_s(PLANT)
        if silence_s is None or self.units.is_alive(PLANT):
            return self._plant
        fault = f"stuck: no report of the measuring process for {silence_s:.0f} s"
        return replace(self._plant, loops=dict.fromkeys(self._plant.loops, fault))

    async def take(self, report: Report, *, is_direct: bool = False) -> None:
        """Apply a report; `is_direct` is False for one from the database, whose age is unknown.

        A baseline that has come into force and cannot be read is not shown; the next report with
        results of its unit tries again.
        """
        for each in report.units:
            if each.unit not in self.units.units:
                continue
            if each.snapshot is not None:
                await self.films.take(each.unit, each.snapshot)
                self.units.set_results(each.unit, each.snapshot.bearings)
                self.alarms.take(each.unit, each.snapshot)
            self.units.update(
                each.unit, report.process, report.number, each.link, is_direct=is_direct
            )
        if report.plant is not None:
            self._plant = report.plant
