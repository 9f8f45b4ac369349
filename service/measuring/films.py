"""Film monitors of all units."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import AlarmIdentity
from core.alarms.kinds import FILM_KINDS
from core.baseline.baseline import BearingBaseline
from core.baseline.history import DIRECTIONS
from core.change.film_judge import FilmJudge, FilmMemory, FilmNews, alarm_condition
from core.change.film_watch import FilmWatch
from core.change.settings import FilmRules
from core.limits import Judgement
from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from service.live.commands import BaselineAction, FilmPlace, step_of
from service.measuring.baseline_learning import Learner
from service.measuring.baseline_versions import UnitStart, in_force, unit_start
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.store.baselines import StoredStep, Versions
from service.store.films import FilmStore
from service.store.port import StoreError

log = structlog.get_logger()

MAX_LEARN_S = 900.0
"""Longest that learning one bearing from its whole history may take."""

KINDS = dict(zip(DIRECTIONS, FILM_KINDS, strict=True))


@dataclass(frozen=True)
class WatchedFilms:
    """A unit's films with their rules and what has been said of them last."""

    rules: FilmRules
    watch: FilmWatch
    newest: dict[str, FilmNews]


class FilmKeeper:
    """Watches films on the event loop; reads and learns in threads.

    Parameters
    ----------
    rules
        Of every unit; where films cannot be watched, why.
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
        self._acting = asyncio.Lock()  # what is done next stands on what was done before
        self.unwatched = {unit: why for unit, why in rules.items() if isinstance(why, str)}
        self._films = {
            unit: _watched(units[unit], found)
            for unit, found in rules.items()
            if isinstance(found, FilmRules)
        }

    async def start(self) -> None:
        """Go on where the service stopped, before anything arrives.

        Raises
        ------
        StoreError
            If what is stored cannot be read: to begin again would lose what was found.
        """
        responses = await asyncio.to_thread(self._store.responses)
        for unit, films in self._films.items():
            response = responses.get(unit)
            found = await asyncio.to_thread(unit_start, self._store, unit, films.rules, response)
            _restore(films.watch, found)

    def memory(self, unit: str) -> FilmMemory | None:
        """What must be known of the films of a unit, beside stored readings, to go on elsewhere."""
        return self._films[unit].watch.memory if unit in self._films else None

    def resume(self, unit: str, memory: FilmMemory | None) -> None:
        """Go on where another process stopped; after `start`."""
        if memory is not None and unit in self._films:
            self._films[unit].watch.restore(memory)

    def rules(self, unit: str) -> FilmRules | None:
        """How the films of a unit are watched; None if they are not."""
        return self._films[unit].rules if unit in self._films else None

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """A bearing with the estimator that it is watched by; None if it is not watched."""
        rules = self.rules(unit)
        if rules is None or bearing not in rules.estimators:
            return None
        return FilmPlace(unit, bearing, rules.estimators[bearing])

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """What has been said of a bearing last since the service started."""
        return self._films[unit].newest.get(bearing) if unit in self._films else None

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """What a bearing is compared with now."""
        films = self._films.get(unit)
        return films.watch.judge.baseline(bearing) if films else None

    def take(
        self, unit: str, assessments: Sequence[Assessment]
    ) -> tuple[Sequence[Assessment], list[FilmNews]]:
        """Say under which condition results were found, and take readings when it is time."""
        films = self._films.get(unit)
        if films is None or not assessments:
            return assessments, []
        seen, news = films.watch.take(assessments)
        films.newest.update({told.reading.bearing: told for told in news})
        return seen, news

    def conditions(self, news: Sequence[FilmNews]) -> dict[str, Judgement]:
        """What alarms make of it, by alarm."""
        return {
            alarm_id(told.reading.unit, told.reading.bearing, direction): alarm_condition(
                finding, self._films[told.reading.unit].rules.change
            )
            for told in news
            for direction, finding in zip(DIRECTIONS, told.findings, strict=True)
        }

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Learn whatever is due, for ever."""
        period_s = min(3600.0, 86_400.0 * self.settings.learn_every_days / 4)
        while True:
            try:
                await self.learn_due(pulse)
            except StoreError as error:
                log.error("baselines are not learned", reason=str(error))
            pulse.beat(period_s)
            await self._clock.sleep(period_s)

    async def learn_due(self, pulse: Pulse = UNHEARD) -> None:
        """Learn every bearing whose turn it is, one after the other."""
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
                await self._learn_response(unit)

    async def learn(self, place: FilmPlace, **why: str) -> BearingBaseline | None:
        """Learn a bearing now; None if there are too few readings."""
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

    async def _learn_response(self, unit: str) -> None:
        films, now_ns = self._films[unit], self._clock.now_ns()
        response = await asyncio.to_thread(self.learner.learn_response, unit, films.rules, now_ns)
        films.watch.judge.set_response(response)

    async def act(
        self, place: FilmPlace, action: BaselineAction, actor: str, reason: str
    ) -> Versions:
        """Do to the baselines of a bearing what an engineer asks for.

        Raises
        ------
        BaselineRefusedError
            If it does not fit the baselines as they are now.
        StoreError
            If it could not be written; then nothing has changed.
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
        return step_of(action, place, versions, entries, actor, reason, self._clock.now_ns())

    async def put_in_force(self, place: FilmPlace) -> None:
        """Compare a bearing with what its stored steps say from now on."""
        films = self._films[place.unit]
        held = films.watch.judge.baseline(place.bearing)
        found = await asyncio.to_thread(in_force, self._store, place, films.rules)
        if found.baseline is None or held is None or found.baseline.origin != held.origin:
            films.watch.judge.activate_baseline(place.bearing, found.baseline, found.decisions)


def alarm_id(unit: str, bearing: str, direction: str) -> str:
    """Alarm of the change of a film."""
    return AlarmIdentity(unit, bearing, KINDS[direction]).id


def _watched(unit: Unit, rules: FilmRules) -> WatchedFilms:
    brackets = {bearing.id: bearing.bracket_stiffness_n_per_m for bearing in unit.bearings}
    return WatchedFilms(rules, FilmWatch(rules, FilmJudge(rules, brackets)), {})


def _restore(watch: FilmWatch, found: UnitStart) -> None:
    watch.restore_operation(found.operation, found.oil)
    for bearing, its in found.bearings.items():
        watch.judge.activate_baseline(bearing, its.baseline, its.decisions)
    watch.judge.add_recent(found.recent)
    watch.judge.set_response(found.response)


async def film_keeper(
    plant: PlantFile, machines: Mapping[str, Unit], store: FilmStore, clock: Clock
) -> FilmKeeper:
    """Put the keeper of all films together and let it go on where the service stopped.

    Raises
    ------
    StoreError
        If what is stored of films cannot be read.
    """
    rules = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
    keeper = FilmKeeper(machines, rules, plant.films, store, clock)
    await keeper.start()
    return keeper
