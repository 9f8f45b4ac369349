"""Film monitor: changes of the oil films of all units against their baselines."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import AlarmIdentity
from core.alarms.kinds import FILM_STIFFNESS
from core.baseline.baseline import BearingBaseline
from core.baseline.history import DIRECTIONS
from core.change.film_judge import FilmJudge, FilmMemory, FilmNews, alarm_condition
from core.change.film_watch import FilmWatch
from core.change.settings import FilmRules
from core.limits import Judgement
from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from service.live.commands import BaselineAction, FilmPlace, baseline_step
from service.measuring.baseline_learning import Learner, in_force, resume_films
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.store.baselines import StoredStep, Versions
from service.store.films import FilmStore
from service.store.port import StoreError

log = structlog.get_logger()

MAX_LEARN_S = 900.0
"""Maximum duration of learning one bearing's baseline from its whole history, s."""


@dataclass(frozen=True)
class WatchedFilms:
    """Films of a unit: rules, state, and newest reading with findings by bearing id."""

    rules: FilmRules
    watch: FilmWatch
    newest: dict[str, FilmNews]


class FilmMonitor:
    """Monitor of the oil films of all units.

    Films are evaluated on the event loop; threads read the store and learn baselines. `rules` are
    the rules for the films of each unit, or the reason why they cannot be monitored, by unit id.
    """

    def __init__(
        self,
        units: Mapping[str, Unit],
        rules: Mapping[str, FilmRules | str],
        settings: FilmAlarmSettings,
        store: FilmStore,
        clock: Clock,
    ) -> None:
        self._store, self._clock, self.settings = store, clock, settings
        self.learner = Learner(store, settings)
        self._acting = asyncio.Lock()  # each action depends on the previous one
        self._films = {
            unit: _watched(units[unit], found)
            for unit, found in rules.items()
            if isinstance(found, FilmRules)
        }

    async def start(self) -> None:
        """Restore the state of all films from stored readings, before the first result.

        Raises `StoreError` if the readings cannot be read; a start without them would lose
        findings.
        """
        responses = await asyncio.to_thread(self._store.responses)
        for unit, films in self._films.items():
            how = (unit, films.rules, responses.get(unit), films.watch)
            await asyncio.to_thread(resume_films, self._store, *how)

    def memory(self, unit: str) -> FilmMemory | None:
        """Return the state of a unit's films for another process; None if not monitored."""
        return self._films[unit].watch.memory if unit in self._films else None

    def resume(self, unit: str, memory: FilmMemory | None) -> None:
        """Restore a unit's films from ``memory`` of another process; call it after `start`."""
        if memory is not None and unit in self._films:
            self._films[unit].watch.restore(memory)

    def rules(self, unit: str) -> FilmRules | None:
        """Return the rules of a unit's films; None if they are not monitored."""
        return self._films[unit].rules if unit in self._films else None

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest film reading of a bearing with findings; None before the first."""
        return self._films[unit].newest.get(bearing) if unit in self._films else None

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force for a bearing; None if no baseline is in force."""
        films = self._films.get(unit)
        return films.watch.judge.baseline(bearing) if films else None

    def take(
        self, unit: str, assessments: Sequence[Assessment]
    ) -> tuple[Sequence[Assessment], list[FilmNews]]:
        """Add the operating condition to results; evaluate the films when a reading is due.

        Returns
        -------
        The results with their operating conditions, and the new film readings with findings.
        """
        films = self._films.get(unit)
        if films is None or not assessments:
            return assessments, []
        seen, news = films.watch.take(assessments)
        films.newest.update({each.reading.bearing: each for each in news})
        return seen, news

    def conditions(self, news: Sequence[FilmNews]) -> dict[str, dict[str, Judgement]]:
        """Return the judgements from new readings, by film alarm id and direction."""
        return {
            AlarmIdentity(each.reading.unit, each.reading.bearing, FILM_STIFFNESS).id: {
                axis: alarm_condition(each.findings, axis) for axis in DIRECTIONS
            }
            for each in news
        }

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Learn due baselines periodically, until cancelled; `pulse` gets heartbeats."""
        period_s = min(3600.0, 86_400.0 * self.settings.learn_every_days / 4)
        while True:
            try:
                await self.learn_due(pulse)
            except StoreError as error:
                log.error("baselines cannot be learned", reason=str(error))
            pulse.beat(period_s)
            await self._clock.sleep(period_s)

    async def learn_due(self, pulse: Pulse = UNHEARD) -> None:
        """Learn all baselines that are due, and the shaft responses of their units."""
        for unit, films in self._films.items():
            pulse.beat(MAX_LEARN_S)
            due = [
                place
                for place in (FilmPlace(unit, *item) for item in films.rules.estimators.items())
                if await asyncio.to_thread(self.learner.is_due, place, self._clock.now_ns())
            ]
            for place in due:
                pulse.beat(MAX_LEARN_S)
                await self.learn(place)
            if due:
                pulse.beat(MAX_LEARN_S)
                response = await asyncio.to_thread(
                    self.learner.learn_response, unit, films.rules, self._clock.now_ns()
                )
                films.watch.judge.response = response

    async def learn(self, place: FilmPlace, **why: str) -> BearingBaseline | None:
        """Learn a baseline of a bearing now; return None if there are too few readings.

        ``why`` are `author` and `reason`, stored with the baseline; default: "padwatch", no reason.
        """
        now_ns = self._clock.now_ns()
        async with self._acting:
            learned = await asyncio.to_thread(self.learner.learn, place, now_ns, **why)
        if learned is not None:
            log.info(
                "baseline learned",
                unit=place.unit,
                bearing=place.bearing,
                version=learned.origin.version,
            )
            await self.put_in_force(place)
        return learned

    async def act(
        self, place: FilmPlace, action: BaselineAction, actor: str, reason: str
    ) -> Versions:
        """Apply an engineer's action to the baselines of a bearing; return their new state.

        `actor` is the name of the engineer, `reason` the reason that the engineer gave.

        Raises
        ------
        BaselineRefusedError
            If the action does not fit the state of the baselines.
        StoreError
            If the action was not stored; nothing is changed.
        """
        async with self._acting:
            step = await asyncio.to_thread(self._step, place, action, actor, reason)
            await asyncio.to_thread(self._store.add_steps, [step])
            await self.put_in_force(place)
        log.info(f"baseline {step.step}", unit=place.unit, bearing=place.bearing, actor=actor)
        return await asyncio.to_thread(self.learner.versions, place)

    def _step(
        self, place: FilmPlace, action: BaselineAction, actor: str, reason: str
    ) -> StoredStep:
        entries = list(self._store.baselines(place.unit, place.bearing))
        versions = self.learner.versions(place)
        return baseline_step(action, place, versions, entries, actor, reason, self._clock.now_ns())

    async def put_in_force(self, place: FilmPlace) -> None:
        """Load and use the baseline that is in force for a bearing according to the database."""
        films = self._films[place.unit]
        held = films.watch.judge.baseline(place.bearing)
        found, decisions = await asyncio.to_thread(in_force, self._store, place, films.rules)
        if found is None or held is None or found.origin != held.origin:
            films.watch.judge.activate_baseline(place.bearing, found, decisions)


def _watched(unit: Unit, rules: FilmRules) -> WatchedFilms:
    brackets = {bearing.id: bearing.bracket_stiffness_n_per_m for bearing in unit.bearings}
    return WatchedFilms(rules, FilmWatch(rules, FilmJudge(rules, brackets)), {})


async def film_monitor(
    plant: PlantFile, machines: Mapping[str, Unit], store: FilmStore, clock: Clock
) -> FilmMonitor:
    """Build the monitor of all films and restore it from stored readings.

    `machines` are the descriptions of the units by unit id. Raises `StoreError` if the readings
    cannot be read.
    """
    rules = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
    monitor = FilmMonitor(machines, rules, plant.films, store, clock)
    await monitor.start()
    return monitor
