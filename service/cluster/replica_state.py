"""What a process that only serves knows of units, alarms, films and receivers."""

import asyncio
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.alarms.alarm import PLANT, Alarm
from core.alarms.statistics import ChatterRule
from core.baseline.baseline import BearingBaseline
from core.change.decision import INITIAL_DECISION
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Level, Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.spectra.cross_spectrum import NO_SPECTRUM
from service.live.alarm_board import AlarmCount, count_of
from service.live.commands import FilmPlace, NotHereError
from service.live.live_view import CurrentBearing, LinkState, UnitStatus
from service.live.unit_state import BearingState, UnitSigns, UnitState
from service.measuring.counters import alarm_metrics, film_metrics, store_info
from service.measuring.service_alarms import SHARED, is_shared, told_by
from service.notifications.metrics import delivery_metrics
from service.notifications.sender import Receiver, ReceiverView, SenderState, SenderStatus
from service.runtime.metrics import gauge
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.store.films import FilmStore
from service.store.outbox import Backlog, Outbox
from service.store.port import StoreError

DRIFT = 1e-3
"""Two steady clocks differ by far less."""


SILENT_AFTER_S = 5.0
"""Reports come every second: who misses several of them is not there, or not reached."""

NOBODY = "no process that analyses this unit gives a sign of life"


@dataclass(frozen=True)
class Known:
    """What was read of a unit last.

    Parameters
    ----------
    beat
        Process and number of the report.
    heard_s
        When it was said, on this process's steady clock: when it was first seen to be another one
        than before, less what it was held up on its way. None if it is the first one of a process:
        nobody knows how old it is.
    shown, silent
        Status while there are signs of life, and when there are none.
    """

    beat: tuple[str, int] | None
    heard_s: float | None
    signs: UnitSigns
    shown: UnitStatus
    silent: UnitStatus
    results: Mapping[str, Assessment] = field(default_factory=dict)


NOTHING = Known(None, None, UnitSigns(UnitStatus(), None, {}), UnitStatus(), UnitStatus())


class ReplicaLive:
    """The newest of everything, by the newest reports; nothing old passes for current.

    Ages are measured by this process's steady clock from the moment at which it saw a report, less
    the report's delay, so that hosts' clocks need not agree and a database that has kept a report
    back makes nothing younger.

    Parameters
    ----------
    stale_after_s
        A result older than this is no longer current.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock, self._stale_after_s = clock, stale_after_s
        self._delays = Delays()
        self._known = dict.fromkeys((*units, PLANT, SHARED), NOTHING)
        self.revision = 0
        self.read_error: str | None = None
        """Why reports cannot be read just now."""

    @property
    def units(self) -> Sequence[str]:
        """All units, `PLANT` and `SHARED`."""
        return tuple(self._known)

    def hear(self, unit: str, process: str, n_beats: int, signs: UnitSigns) -> None:
        """Take the newest report on a unit; one that is known already tells nothing."""
        known, beat = self._known[unit], (process, n_beats)
        if known.beat == beat:
            return
        self.revision += 1
        now_s = self._clock.monotonic_s()
        delay_s = self._delays.delay_s(process, signs.said_s, now_s)
        is_first = known.beat is None or known.beat[0] != process
        heard_s = None if is_first else now_s - delay_s
        received_s = None
        if heard_s is not None and signs.data_age_s is not None:
            received_s = heard_s - signs.data_age_s
        shown = replace(signs.status, received_s=received_s)
        silent = replace(shown, state=LinkState.NOT_CONNECTED, reason=NOBODY, since_ns=None)
        self._known[unit] = replace(
            known, beat=beat, heard_s=heard_s, signs=signs, shown=shown, silent=silent
        )

    def set_results(self, unit: str, results: Mapping[str, BearingState]) -> None:
        """Take the newest results of a unit."""
        self.revision += 1
        found = {b: _assessment(unit, b, state) for b, state in results.items()}
        self._known[unit] = replace(self._known[unit], results=found)

    def silence_s(self, unit: str) -> float | None:
        """Time since the last sign of life of whoever analyses a unit; None if there was none."""
        heard_s = self._known[unit].heard_s
        return None if heard_s is None else self._clock.monotonic_s() - heard_s

    def is_alive(self, unit: str) -> bool:
        """Whether somebody analyses a unit, and says so."""
        silence_s = self.silence_s(unit)
        return silence_s is not None and silence_s <= SILENT_AFTER_S

    @property
    def store_error(self) -> str | None:
        """Why reports cannot be read, or a process that is there cannot store."""
        said = (self._known[u].signs.store_error for u in self._known if self.is_alive(u))
        return self.read_error or next((error for error in said if error), None)

    @property
    def n_unstored(self) -> int:
        """Findings that processes have given up since they were started."""
        by_process = {k.beat[0]: k.signs.n_unstored for k in self._known.values() if k.beat}
        return sum(by_process.values())

    def status(self, unit: str) -> UnitStatus:
        """How samples of a unit arrive; nobody knows that of a unit that nobody reports on."""
        known = self._known[unit]
        if known.beat is None:
            return NOT_REPORTED
        return known.shown if self.is_alive(unit) else known.silent

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Raise `NotHereError`: samples stay in the process that analyses them."""
        raise NotHereError(f"live samples of unit {unit} are not available from this replica")

    def newest_block(self, unit: str) -> SampleBlock | None:  # noqa: ARG002  as the port has it
        """Return None: samples stay in the process that analyses them."""
        return None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Why the newest samples of a unit are not current; None if they are."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Time since the newest block arrived where it is analysed; None if nobody knows."""
        return self._age_s(unit, self._known[unit].signs.data_age_s)

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Nothing if there is no result; else raise `NotHereError`: arrays stay where they are."""
        if bearing not in self._known[unit].results:
            return None
        raise NotHereError(
            f"live spectra and orbits of unit {unit} are not available from this replica;"
            " spectra over time are"
        )

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """The newest result as it may be shown."""
        known = self._known[unit]
        result = known.results.get(bearing)
        age_s = self._age_s(unit, known.signs.result_ages_s.get(bearing))
        reason = self._why_not_current(unit, age_s)
        if result is None or reason is not None:
            nothing = missing(reason or Reason.WAITING_FOR_DATA)
            return CurrentBearing(
                assessment=result,
                age_s=age_s,
                quality=bad(nothing.quality.reason),
                readings={quantity.name: nothing for quantity in CATALOGUE},
                is_current=False,
            )
        return CurrentBearing(result, age_s, result.quality, result.readings, is_current=True)

    def _age_s(self, unit: str, then_s: float | None) -> float | None:
        silence_s = self.silence_s(unit)
        return None if then_s is None or silence_s is None else then_s + silence_s

    def _why_not_current(self, unit: str, age_s: float | None) -> Reason | None:
        if self.status(unit).state is not LinkState.CONNECTED:
            return Reason.NOT_CONNECTED
        if age_s is None:
            return Reason.WAITING_FOR_DATA
        return Reason.STALE if age_s > self._stale_after_s else None


NOT_REPORTED = UnitStatus(LinkState.NOT_CONNECTED, NOBODY)


def _assessment(unit: str, bearing: str, state: BearingState) -> Assessment:
    return Assessment(unit, bearing, spectrum=NO_SPECTRUM, orbit=None, **vars(state))


Key = tuple[str, str]
"""Unit and bearing."""


class ReplicaFilms:
    """Looks at reports for what was found, and at the store for baselines."""

    def __init__(self, plant: PlantFile, store: FilmStore) -> None:
        self._store = store
        found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
        self._settings = plant.films
        self._rules = {unit: rules for unit, rules in found.items() if isinstance(rules, FilmRules)}
        self._unwatched = {unit: why for unit, why in found.items() if isinstance(why, str)}
        self._newest: dict[Key, FilmNews] = {}
        self._baselines: dict[Key, BearingBaseline] = {}

    @property
    def settings(self) -> FilmAlarmSettings:
        """How films are watched."""
        return self._settings

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Why films cannot be watched, by unit where they cannot."""
        return self._unwatched

    def rules(self, unit: str) -> FilmRules | None:
        """How the films of a unit are watched; None if they are not."""
        return self._rules.get(unit)

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """A bearing with the estimator that it is watched by; None if it is not watched."""
        rules = self.rules(unit)
        if rules is None or bearing not in rules.estimators:
            return None
        return FilmPlace(unit, bearing, rules.estimators[bearing])

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """What has been said of a bearing last."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """What a bearing is compared with now."""
        return self._baselines.get((unit, bearing))

    def fetch(self, unit: str, state: UnitState) -> Mapping[str, BearingBaseline]:
        """Read the baselines that are in force by what was written down; blocks.

        Raises
        ------
        StoreError
            If they cannot be read.
        """
        found = {}
        for bearing, in_force in state.baselines.items():
            held = self.baseline(unit, bearing)
            is_held = held is not None and held.origin.version == in_force
            baseline = held if is_held else self._store.baseline(unit, bearing, in_force)
            if baseline is not None:
                found[bearing] = baseline
        return found

    def take(self, unit: str, state: UnitState, baselines: Mapping[str, BearingBaseline]) -> None:
        """Take what was written down of a unit, with the baselines that `fetch` has read."""
        for bearing, film in state.films.items():
            news = FilmNews(film.reading, film.findings, (INITIAL_DECISION, INITIAL_DECISION))
            self._newest[unit, bearing] = news
        others = {key: held for key, held in self._baselines.items() if key[0] != unit}
        self._baselines = others | {(unit, b): found for b, found in baselines.items()}


class ReplicaAlarms:
    """The newest of each alarm, from reports and from the table of alarms.

    Parameters
    ----------
    is_alive
        Whether a unit is analysed; of one that is not, nothing can be judged.
    """

    def __init__(
        self, units: Iterable[str], is_alive: Callable[[str], bool], chatter_rule: ChatterRule
    ) -> None:
        self._units = frozenset(units)
        self._is_alive, self.chatter_rule = is_alive, chatter_rule
        self._alarms: dict[str, Alarm] = {}
        self._judged: dict[str, frozenset[str]] = {}
        self._chattering: dict[str, frozenset[str]] = {}
        self._alive: dict[str, bool] = {}
        self._revision = 0

    @property
    def revision(self) -> int:
        """Another number as soon as anything is known otherwise of any alarm."""
        alive = {unit: self._is_alive(unit) for unit in self._judged}
        if alive != self._alive:  # somebody has fallen silent, of which no report tells
            self._alive = alive
            self._revision += 1
        return self._revision

    def take(self, unit: str, state: UnitState) -> None:
        """Take what was written down of a unit."""
        self._revision += 1
        self._judged[unit], self._chattering[unit] = state.judged, state.chattering
        # a process may remember alarms of units that others have taken over
        self.take_stored(alarm for alarm in state.alarms if self._owner(alarm) == unit)

    def take_stored(self, alarms: Iterable[Alarm]) -> None:
        """Take alarms, unless something later is known of them."""
        self._revision += 1
        for alarm in alarms:
            held = self._alarms.get(alarm.identity.id)
            if held is None or alarm.n_events >= held.n_events:
                self._alarms[alarm.identity.id] = alarm

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, whatever their state."""
        return list(self._alarms.values())

    def alarm(self, id_: str) -> Alarm:
        """Look an alarm up. Raises `LookupError` if there is none."""
        return self._alarms[id_]

    def is_judged(self, alarm: Alarm) -> bool:
        """Whether what an alarm watches is known now; nothing is where nobody analyses."""
        unit = self._owner(alarm)
        return self._is_alive(unit) and alarm.identity.id in self._judged.get(unit, ())

    def is_chattering(self, alarm: Alarm) -> bool:
        """Whether an alarm has come and gone too often until a short while ago."""
        return alarm.identity.id in self._chattering.get(self._owner(alarm), ())

    def owner(self, id_: str) -> str:
        """Whose process does something to an alarm. Raises `LookupError` if there is none."""
        return self._owner(self.alarm(id_))

    def _owner(self, alarm: Alarm) -> str:
        """Its unit, or who else tells of it where it is of no unit that there is."""
        if is_shared(alarm):
            return SHARED
        unit = told_by(alarm.identity)
        return unit if unit in self._units else PLANT

    def count(self) -> AlarmCount:
        """How many alarms are on the list."""
        return count_of(self.alarms, self.is_judged)


class NoCaptures:
    """Nothing is captured here."""

    error: str | None = None
    trouble: str | None = None
    n_running = 0
    n_written = 0
    being_made: frozenset[tuple[str, int]] = frozenset()


class ReplicaDeliveries:
    """Looks at the outbox; sends nothing."""

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox) -> None:
        self._receivers, self._outbox = {r.name: r for r in receivers}, outbox

    async def look(self) -> list[ReceiverView]:
        """Look at all receivers.

        Raises
        ------
        StoreError
            If the outbox cannot be read.
        """
        return await asyncio.to_thread(self._look)

    def _look(self) -> list[ReceiverView]:
        backlogs = {backlog.receiver: backlog for backlog in self._outbox.backlogs()}
        others = [name for name in backlogs if name not in self._receivers]
        return [self._view(name, backlogs.get(name)) for name in (*self._receivers, *others)]

    def _view(self, name: str, backlog: Backlog | None) -> ReceiverView:
        receiver = self._receivers.get(name)
        return ReceiverView(name, receiver, self._status(name) if receiver else None, backlog)

    def _status(self, name: str) -> SenderStatus:
        """By the first letter that waits: whether it was tried in vain, and why."""
        waiting = self._outbox.waiting(name, 1)
        if not waiting:
            return SenderStatus()
        first = waiting[0]
        if not first.n_attempts:
            return SenderStatus(SenderState.SENDING)
        return SenderStatus(SenderState.RETRYING, first.n_attempts, first.queued_ns, first.answer)


UNIT = ("unit",)


@dataclass(frozen=True)
class ReplicaMetrics:
    """What a replica's metrics are read from.

    Parameters
    ----------
    bearings
        Of every unit.
    """

    bearings: Mapping[str, Sequence[str]]
    live: ReplicaLive
    alarms: ReplicaAlarms
    films: ReplicaFilms
    deliveries: ReplicaDeliveries
    clock: Clock
    store_kind: str

    async def scrape(self) -> "ReplicaScrape":
        """Look at all of it; an outbox that cannot be read is a metric, no error."""
        try:
            return ReplicaScrape(self, await self.deliveries.look())
        except StoreError:
            return ReplicaScrape(self, None)


@dataclass(frozen=True)
class ReplicaScrape:
    """All metrics at one moment.

    Parameters
    ----------
    receivers
        What waits for whom; None if that could not be read.
    """

    of: ReplicaMetrics
    receivers: Sequence[ReceiverView] | None

    def collect(self) -> Iterator[Metric]:
        """All families."""
        of = self.of
        which = ((version("padwatch"), platform.python_version()), 1)
        yield gauge(
            "build_info",
            "1; which padwatch this is, and by which Python it runs.",
            ("version", "python"),
            [which],
        )
        yield store_info(of.store_kind)
        yield from unit_metrics(of)
        yield _bearing_metric(of)
        yield from alarm_metrics(of.alarms, of.bearings)
        yield from film_metrics(of.films.newest, of.bearings)
        yield from delivery_metrics(self.receivers, of.clock.now_ns())
        yield from ProcessCollector(registry=None).collect()


def unit_metrics(of: ReplicaMetrics) -> Iterator[Metric]:
    """How each unit is, as far as this replica has been told."""
    live, units = of.live, list(of.bearings)
    connected = (((u,), live.status(u).state is LinkState.CONNECTED) for u in units)
    yield gauge("link_connected", "1 while the device is connected.", UNIT, connected)
    alive = (((u,), live.is_alive(u)) for u in units)
    yield gauge("unit_analysed", "1 while a process says that it analyses the unit.", UNIT, alive)
    silence = (((u,), s) for u in units if (s := live.silence_s(u)) is not None)
    meaning = "Since the last sign of life of whoever analyses the unit."
    yield gauge("unit_silence_seconds", meaning, UNIT, silence)
    ages = (((u,), age) for u in units if (age := live.data_age_s(u)) is not None)
    yield gauge("data_age_seconds", "Since samples arrived last.", UNIT, ages)
    is_readable = [((), live.read_error is None)]
    yield gauge("reports_readable", "1 if the database could be read.", (), is_readable)


def _bearing_metric(of: ReplicaMetrics) -> Metric:
    found = Counter(
        (unit, of.live.current(unit, bearing).quality.level)
        for unit, bearings in of.bearings.items()
        for bearing in bearings
    )
    return gauge(
        "bearings",
        "Bearings by the quality of what is known of them now; bad without a current result.",
        ("unit", "quality"),
        (((u, level.name.lower()), found[u, level]) for u in of.bearings for level in Level),
    )


class Delays:
    """Compares each report with the quickest of its process: steady clocks are a constant apart.

    What every report takes at least is not seen: a look at the database twice a second keeps it
    below half a second.
    """

    def __init__(self) -> None:
        self._quickest: dict[str, tuple[float, float]] = {}

    def delay_s(self, process: str, said_s: float | None, heard_s: float) -> float:
        """For how much longer than the quickest this report was on its way.

        Parameters
        ----------
        said_s
            On the process's steady clock; None if it does not say so.
        heard_s
            On the steady clock of whoever asks.
        """
        if said_s is None:
            return 0.0
        apart_s = heard_s - said_s
        quickest_s, seen_s = self._quickest.get(process, (apart_s, heard_s))
        quickest_s = min(apart_s, quickest_s + DRIFT * (heard_s - seen_s))
        self._quickest[process] = (quickest_s, heard_s)
        return apart_s - quickest_s
