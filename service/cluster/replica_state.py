"""Live state, films and alarms of a replica, a process that only serves, from the database."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from acquisition.clock import Clock
from core.alarms.alarm import PLANT, Alarm
from core.alarms.statistics import ChatterRule
from core.baseline.baseline import BearingBaseline
from core.change.decision import INITIAL_DECISION
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.spectra.cross_spectrum import NO_SPECTRUM
from service.live.alarm_list import AlarmCount, count_of
from service.live.commands import FilmPlace, NotAvailableError
from service.live.live_view import CurrentBearing, LinkState, UnitStatus
from service.live.unit_state import BearingState, UnitSigns, UnitState
from service.measuring.reported_alarms import SHARED, is_shared
from service.measuring.service_alarms import reporting_unit
from service.settings.core_values import film_rules_of
from service.settings.plant import PlantFile
from service.store.films import FilmStore

MAX_DRIFT = 1e-3
"""Upper bound of the relative drift of two monotonic clocks."""

SILENT_AFTER_S = 5.0
"""Age of the last report above which a unit counts as not analysed; the interval is one second."""

NOT_ANALYSED = "no process that analyses this unit is alive"

NOT_REPORTED = UnitStatus(LinkState.NOT_CONNECTED, NOT_ANALYSED)


NO_SIGNS = UnitSigns(UnitStatus(), None, {})


@dataclass(frozen=True)
class LatestReport:
    """Latest report on a unit.

    Parameters
    ----------
    beat
        Process and number of the report; None before the first report.
    sent_s
        Time of sending, by the monotonic clock of this process; None for the first report of a
        process, whose age is unknown.
    status
        Status of the samples of the unit, valid while reports arrive.
    """

    beat: tuple[str, int] | None = None
    sent_s: float | None = None
    signs: UnitSigns = NO_SIGNS
    status: UnitStatus = NO_SIGNS.status
    results: Mapping[str, Assessment] = field(default_factory=dict)


class ReplicaLive:
    """Live view of a replica, built from the latest reports; stale values are not shown as current.

    Ages are measured by the monotonic clock of this process from the arrival of a report, minus the
    delay of the report. Therefore the clocks of the hosts need not agree, and a report that the
    database delays does not make its values appear newer.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock, self._stale_after_s = clock, stale_after_s
        self._delays = ReportDelays()
        self._latest = dict.fromkeys((*units, PLANT, SHARED), LatestReport())
        self.revision = 0
        self.read_error: str | None = None
        """Reason why reports cannot be read; None if they can be read."""

    @property
    def units(self) -> Sequence[str]:
        """Ids of all units, and the pseudo-units `PLANT` and `SHARED`."""
        return tuple(self._latest)

    def update(self, unit: str, process: str, n_beats: int, signs: UnitSigns) -> None:
        """Apply the latest report on a unit; a report that was already applied has no effect."""
        latest, beat = self._latest[unit], (process, n_beats)
        if latest.beat == beat:
            return
        self.revision += 1
        now_s = self._clock.monotonic_s()
        delay_s = self._delays.delay_s(process, signs.said_s, now_s)
        is_first = latest.beat is None or latest.beat[0] != process
        sent_s = None if is_first else now_s - delay_s
        received_s = None
        if sent_s is not None and signs.data_age_s is not None:
            received_s = sent_s - signs.data_age_s
        status = replace(signs.status, received_s=received_s)
        self._latest[unit] = replace(latest, beat=beat, sent_s=sent_s, signs=signs, status=status)

    def set_results(self, unit: str, results: Mapping[str, BearingState]) -> None:
        """Set the newest results of a unit, by bearing."""
        self.revision += 1
        found = {
            bearing: Assessment(unit, bearing, spectrum=NO_SPECTRUM, orbit=None, **vars(state))
            for bearing, state in results.items()
        }
        self._latest[unit] = replace(self._latest[unit], results=found)

    def silence_s(self, unit: str) -> float | None:
        """Return the age of the last report on a unit, s; None if unknown."""
        sent_s = self._latest[unit].sent_s
        return None if sent_s is None else self._clock.monotonic_s() - sent_s

    def is_alive(self, unit: str) -> bool:
        """Return whether a process analyses the unit and reports on it."""
        silence_s = self.silence_s(unit)
        return silence_s is not None and silence_s <= SILENT_AFTER_S

    @property
    def store_error(self) -> str | None:
        """Reason why reports are unreadable, or why a process cannot store results; None if ok."""
        errors = (self._latest[u].signs.store_error for u in self._latest if self.is_alive(u))
        return self.read_error or next((error for error in errors if error), None)

    @property
    def n_unstored(self) -> int:
        """Number of findings that the reporting processes have lost since their start."""
        latest = self._latest.values()
        return sum({each.beat[0]: each.signs.n_unstored for each in latest if each.beat}.values())

    def status(self, unit: str) -> UnitStatus:
        """Return the status of the samples of a unit; not connected while reports are missing."""
        latest = self._latest[unit]
        if latest.beat is None:
            return NOT_REPORTED
        if self.is_alive(unit):
            return latest.status
        return replace(
            latest.status, state=LinkState.NOT_CONNECTED, reason=NOT_ANALYSED, since_ns=None
        )

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Raise `NotAvailableError`; only the analysing process has the samples of a unit."""
        raise NotAvailableError(f"live samples of unit {unit} are not available from this replica")

    def newest_block(self, unit: str) -> SampleBlock | None:  # noqa: ARG002  interface of LiveView
        """Return None; only the analysing process has the samples of a unit."""
        return None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return the reason why the newest samples of a unit are not current; None if current."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest sample block of a unit, s; None if unknown."""
        return self._age_s(unit, self._latest[unit].signs.data_age_s)

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return None if a bearing has no result.

        Otherwise raise `NotAvailableError`, as reports do not include spectra and orbits.
        """
        if bearing not in self._latest[unit].results:
            return None
        raise NotAvailableError(
            f"live spectra and orbits of unit {unit} are not available from this replica;"
            " spectra over time are"
        )

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result of a bearing; its readings are missing if it is not current."""
        latest = self._latest[unit]
        result = latest.results.get(bearing)
        age_s = self._age_s(unit, latest.signs.result_ages_s.get(bearing))
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


class ReportDelays:
    """Estimator of the delay of each report relative to the fastest report of its process.

    Two monotonic clocks differ by a constant offset. The delay common to all reports is not
    observable; since the database is read twice a second, it is below half a second.
    """

    def __init__(self) -> None:
        self._fastest: dict[str, tuple[float, float]] = {}

    def delay_s(self, process: str, sent_s: float | None, received_s: float) -> float:
        """Return the delay of a report relative to the fastest report of its process, s.

        Parameters
        ----------
        sent_s
            Time of sending by the monotonic clock of the reporting process; None if not reported.
        received_s
            Time of arrival by the monotonic clock of this process.
        """
        if sent_s is None:
            return 0.0
        offset_s = received_s - sent_s
        fastest_s, since_s = self._fastest.get(process, (offset_s, received_s))
        fastest_s = min(offset_s, fastest_s + MAX_DRIFT * (received_s - since_s))
        self._fastest[process] = (fastest_s, received_s)
        return offset_s - fastest_s


Key = tuple[str, str]
"""Unit id and bearing id."""


class ReplicaFilms:
    """Film monitoring state of a replica: verdicts from reports, baselines from the store."""

    def __init__(self, plant: PlantFile, store: FilmStore) -> None:
        self._store = store
        found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
        self._rules = {unit: rules for unit, rules in found.items() if isinstance(rules, FilmRules)}
        self.settings = plant.films
        self.unwatched = {unit: why for unit, why in found.items() if isinstance(why, str)}
        """Reason why films are not monitored, by unit; only units without film monitoring."""
        self._newest: dict[Key, FilmNews] = {}
        self._baselines: dict[Key, BearingBaseline] = {}

    def rules(self, unit: str) -> FilmRules | None:
        """Return the film rules of a unit; None if its films are not monitored."""
        return self._rules.get(unit)

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """Return unit, bearing and watched estimator; None if the film is not monitored."""
        rules = self.rules(unit)
        if rules is None or bearing not in rules.estimators:
            return None
        return FilmPlace(unit, bearing, rules.estimators[bearing])

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest verdict on the film of a bearing; None if there is none."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force for a bearing; None if there is none."""
        return self._baselines.get((unit, bearing))

    def fetch(self, unit: str, state: UnitState) -> Mapping[str, BearingBaseline]:
        """Return the baselines in force according to a state, by bearing.

        Reads the database and blocks. Raises `StoreError` if the baselines are unreadable.
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
        """Apply the state of a unit and the baselines that `fetch` returned for this state."""
        for bearing, film in state.films.items():
            news = FilmNews(film.reading, film.findings, (INITIAL_DECISION, INITIAL_DECISION))
            self._newest[unit, bearing] = news
        others = {key: held for key, held in self._baselines.items() if key[0] != unit}
        self._baselines = others | {(unit, b): found for b, found in baselines.items()}


class ReplicaAlarms:
    """Alarms of a replica, from reports and the alarm table; a silent unit has no judged alarms."""

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
        """Revision number, which increases when any alarm changes."""
        alive = {unit: self._is_alive(unit) for unit in self._judged}
        if alive != self._alive:  # the end of the reports is detected only by their age
            self._alive = alive
            self._revision += 1
        return self._revision

    def take(self, unit: str, state: UnitState) -> None:
        """Apply the reported state of a unit to its alarms."""
        self._revision += 1
        self._judged[unit], self._chattering[unit] = state.judged, state.chattering
        # a process may still have alarms of a unit that another process has taken over
        self.take_stored(alarm for alarm in state.alarms if self._owner(alarm) == unit)

    def take_stored(self, alarms: Iterable[Alarm]) -> None:
        """Apply stored alarms that are not older than the known state of the same alarm."""
        self._revision += 1
        for alarm in alarms:
            held = self._alarms.get(alarm.identity.id)
            if held is None or alarm.n_events >= held.n_events:
                self._alarms[alarm.identity.id] = alarm

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, in any state."""
        return list(self._alarms.values())

    def alarm(self, id_: str) -> Alarm:
        """Return an alarm. Raises `LookupError` if it does not exist."""
        return self._alarms[id_]

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is currently known."""
        unit = self._owner(alarm)
        return self._is_alive(unit) and alarm.identity.id in self._judged.get(unit, ())

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm is chattering: raised too often in a short time."""
        return alarm.identity.id in self._chattering.get(self._owner(alarm), ())

    def owner(self, id_: str) -> str:
        """Return the unit whose process owns an alarm. Raises `LookupError` for an unknown id."""
        return self._owner(self.alarm(id_))

    def _owner(self, alarm: Alarm) -> str:
        if is_shared(alarm):
            return SHARED
        unit = reporting_unit(alarm.identity)
        return unit if unit in self._units else PLANT

    def count(self) -> AlarmCount:
        """Return the numbers of alarms on the alarm list."""
        return count_of(self.alarms, self.is_judged)
