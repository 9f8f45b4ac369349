"""Film monitor: changes of the oil films of all units against their baselines."""

import asyncio
from collections.abc import Mapping, Sequence

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
from service.live import commands
from service.live.commands import BaselineAction, BaselineRefusedError, FilmPlace
from service.measuring.baseline_learning import Learner, in_force, places_of, resume_films
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.store.baselines import BaselineEntry, BaselineStep, StoredStep, Versions
from service.store.films import FilmStore
from service.store.port import StoreError

log = structlog.get_logger()

MAX_LEARN_S = 900.0
"""Maximum duration of learning one bearing's baseline from its whole history, s."""


class FilmMonitor:
    """Monitor of the oil films of all units.

    Films are evaluated on the event loop; threads read the store and learn baselines. `rules` are
    the rules for the films of each monitored unit, by unit id.
    """

    def __init__(
        self,
        units: Mapping[str, Unit],
        rules: Mapping[str, FilmRules],
        settings: FilmAlarmSettings,
        store: FilmStore,
        clock: Clock,
    ) -> None:
        self._store, self._clock, self.settings = store, clock, settings
        self.learner = Learner(store, settings)
        self._acting = asyncio.Lock()  # each action depends on the previous one
        self._rules = rules
        self._watches = {}
        for unit, its in rules.items():
            brackets = {each.id: each.bracket_stiffness_n_per_m for each in units[unit].bearings}
            self._watches[unit] = FilmWatch(its, FilmJudge(its, brackets))
        self._newest: dict[tuple[str, str], FilmNews] = {}

    async def start(self) -> None:
        """Restore the state of all films from stored readings, before the first result.

        Raises `StoreError` if the readings cannot be read; a start without them would lose
        findings.
        """
        responses = await asyncio.to_thread(self._store.responses)
        for unit, watch in self._watches.items():
            how = (unit, self._rules[unit], responses.get(unit), watch)
            await asyncio.to_thread(resume_films, self._store, *how)

    def memory(self, unit: str) -> FilmMemory | None:
        """Return the state of a unit's films for another process; None if not monitored."""
        return self._watches[unit].memory if unit in self._watches else None

    def resume(self, unit: str, memory: FilmMemory | None) -> None:
        """Restore a unit's films from ``memory`` of another process; call it after `start`."""
        if memory is not None and unit in self._watches:
            self._watches[unit].restore(memory)

    def rules(self, unit: str) -> FilmRules | None:
        """Return the rules of a unit's films; None if they are not monitored."""
        return self._rules.get(unit)

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest film reading of a bearing with findings; None before the first."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force for a bearing; None if no baseline is in force."""
        watch = self._watches.get(unit)
        return watch.judge.baseline(bearing) if watch else None

    def take(
        self, unit: str, assessments: Sequence[Assessment]
    ) -> tuple[Sequence[Assessment], list[FilmNews]]:
        """Add the operating condition to results; evaluate the films when a reading is due.

        Returns
        -------
        The results with their operating conditions, and the new film readings with findings.
        """
        watch = self._watches.get(unit)
        if watch is None or not assessments:
            return assessments, []
        seen, news = watch.take(assessments)
        self._newest |= {(unit, each.reading.bearing): each for each in news}
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
        for unit, rules in self._rules.items():
            pulse.beat(MAX_LEARN_S)
            due = [
                place
                for place in places_of(unit, rules)
                if await asyncio.to_thread(self.learner.is_due, place, self._clock.now_ns())
            ]
            for place in due:
                pulse.beat(MAX_LEARN_S)
                await self._learn(place)
            if due:
                pulse.beat(MAX_LEARN_S)
                response = await asyncio.to_thread(
                    self.learner.learn_response, unit, rules, self._clock.now_ns()
                )
                self._watches[unit].judge.response = response

    async def _learn(self, place: FilmPlace) -> None:
        """Learn a baseline of a bearing now, if there are enough readings."""
        now_ns = self._clock.now_ns()
        async with self._acting:
            learned = await asyncio.to_thread(self.learner.learn, place, now_ns)
        if learned is not None:
            version = learned.origin.version
            log.info("baseline learned", unit=place.unit, bearing=place.bearing, version=version)
            await self._put_in_force(place)

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Apply an engineer's action to the baselines of a bearing.

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
            await self._put_in_force(place)
        log.info(f"baseline {step.step}", unit=place.unit, bearing=place.bearing, actor=actor)

    def _step(
        self, place: FilmPlace, action: BaselineAction, actor: str, reason: str
    ) -> StoredStep:
        versions, now_ns = self.learner.versions(place), self._clock.now_ns()
        entries = {each.version: each for each in self._store.baselines(place.unit, place.bearing)}
        _require_possible(action, place, versions, entries, now_ns)
        version: int | None = versions.in_force
        from_ns: int | None = None
        match action:
            case commands.Accept(version):
                step = BaselineStep.ACCEPTED
            case commands.Reject(version):
                is_in_force = version == versions.in_force
                step = BaselineStep.WITHDRAWN if is_in_force else BaselineStep.REJECTED
            case commands.Freeze():
                step = BaselineStep.FROZEN
            case commands.Thaw():
                step = BaselineStep.THAWED
            case commands.Renew(from_ns):
                step, version = BaselineStep.RENEWED, None
        return StoredStep(place.unit, place.bearing, version, step, now_ns, actor, reason, from_ns)

    async def _put_in_force(self, place: FilmPlace) -> None:
        """Load and use the baseline that is in force for a bearing according to the database."""
        judge, rules = self._watches[place.unit].judge, self._rules[place.unit]
        held = judge.baseline(place.bearing)
        found, decisions = await asyncio.to_thread(in_force, self._store, place, rules)
        if found is None or held is None or found.origin != held.origin:
            judge.activate_baseline(place.bearing, found, decisions)


def _require_possible(
    action: BaselineAction,
    place: FilmPlace,
    versions: Versions,
    entries: Mapping[int, BaselineEntry],
    now_ns: int,
) -> None:
    """Raise `BaselineRefusedError` if an action does not fit the state of a bearing's baselines.

    `entries` are all baselines of the bearing, by version; `now_ns` is the host time, ns.
    """
    version, renewed_ns, fault = versions.in_force, versions.renewed_ns, None
    match action:
        case commands.Accept(wanted) | commands.Reject(wanted) if wanted not in entries:
            fault = f"version {wanted} does not exist; choose a listed version"
        case commands.Accept(wanted) if wanted == version:
            fault = f"version {wanted} is already in force"
        case commands.Accept(wanted) if entries[wanted].estimator is not place.estimator:
            fault = (
                f"version {wanted} was learned with estimator {entries[wanted].estimator};"
                f" the plant file selects {place.estimator}"
            )
        case commands.Accept(wanted) if entries[wanted].learned_from_ns < (renewed_ns or 0):
            fault = f"version {wanted} is older than the last machine event; accept a later one"
        case commands.Reject(wanted) if wanted in versions.rejected:
            fault = f"version {wanted} is already rejected"
        case commands.Freeze() if versions.is_frozen:
            fault = f"the baseline of {place.bearing} is already frozen"
        case commands.Freeze() if version is None:
            fault = f"{place.bearing} has no baseline in force; accept one"
        case commands.Thaw() if not versions.is_frozen:
            fault = f"the baseline of {place.bearing} is not frozen"
        case commands.Renew(from_ns) if from_ns > now_ns:
            fault = "the time of a machine event must not be in the future"
        case commands.Renew(from_ns) if from_ns < (renewed_ns or 0):
            fault = "a later machine event exists; enter a time after it"
    if fault is not None:
        raise BaselineRefusedError(fault)


async def film_monitor(
    plant: PlantFile, machines: Mapping[str, Unit], store: FilmStore, clock: Clock
) -> FilmMonitor:
    """Build the monitor of all films and restore it from stored readings.

    `machines` are the descriptions of the units by unit id. Raises `StoreError` if the readings
    cannot be read.
    """
    found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
    rules = {unit: its for unit, its in found.items() if isinstance(its, FilmRules)}
    monitor = FilmMonitor(machines, rules, plant.films, store, clock)
    await monitor.start()
    return monitor
