"""Live view, films and alarms of a replica, which serves the HTTP API from stored reports."""

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
"""Age of the last report above which a unit is not analysed, s; reports have a period of 1 s."""

NOT_ANALYSED = "no process is analysing this unit"

NOT_REPORTED = UnitStatus(LinkState.NOT_CONNECTED, NOT_ANALYSED)


NO_SIGNS = UnitSigns(UnitStatus(), None, {})


@dataclass(frozen=True)
class LatestReport:
    """Latest report on a unit, and the link status derived from the report.

    Parameters
    ----------
    beat
        Process and sequence number of the report; None before the first report.
    sent_s
        Time at which the report was sent, by the monotonic clock of this process, s. None for the
        first report of a process, whose age is unknown.
    status
        Link status of the unit, valid while reports arrive.
    results
        Newest result of each bearing, by bearing id.
    """

    beat: tuple[str, int] | None = None
    sent_s: float | None = None
    signs: UnitSigns = NO_SIGNS
    status: UnitStatus = NO_SIGNS.status
    results: Mapping[str, Assessment] = field(default_factory=dict)


class ReplicaLive:
    """Live view of a replica, from the latest reports; outdated values are not shown as current.

    Ages count from the send time of a report, by the monotonic clock of this process: the arrival
    minus the estimated delay. The clocks of the hosts need not agree, and the delay of a report by
    the database does not reduce the ages of its values.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock, self._stale_after_s = clock, stale_after_s
        self._delays = ReportDelays()
        self._latest = dict.fromkeys((*units, PLANT, SHARED), LatestReport())
        self.revision = 0
        self.read_error: str | None = None
        """Error of the newest attempt to read the reports; None if the attempt succeeded."""

    @property
    def units(self) -> Sequence[str]:
        """All units of the plant, and the pseudo-units `PLANT` and `SHARED`."""
        return tuple(self._latest)

    def update(self, unit: str, process: str, n_beats: int, signs: UnitSigns) -> None:
        """Apply the latest report on a unit; a report that was applied before has no effect.

        ``n_beats`` is the sequence number of the report in its ``process``.
        """
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
        """Set the newest results of a unit, by bearing id."""
        self.revision += 1
        found = {
            bearing: Assessment(unit, bearing, spectrum=NO_SPECTRUM, orbit=None, **vars(state))
            for bearing, state in results.items()
        }
        self._latest[unit] = replace(self._latest[unit], results=found)

    def silence_s(self, unit: str) -> float | None:
        """Return the time since the last report on a unit, s; None before a report of known age."""
        sent_s = self._latest[unit].sent_s
        return None if sent_s is None else self._clock.monotonic_s() - sent_s

    def is_alive(self, unit: str) -> bool:
        """Return whether a process has reported on the unit within `SILENT_AFTER_S`."""
        silence_s = self.silence_s(unit)
        return silence_s is not None and silence_s <= SILENT_AFTER_S

    @property
    def store_error(self) -> str | None:
        """Error of reading reports, or store error of a process that is alive; None without one."""
        errors = (self._latest[u].signs.store_error for u in self._latest if self.is_alive(u))
        return self.read_error or next((error for error in errors if error), None)

    @property
    def n_unstored(self) -> int:
        """Number of findings that the reporting processes have not stored since their start."""
        latest = self._latest.values()
        return sum({each.beat[0]: each.signs.n_unstored for each in latest if each.beat}.values())

    def status(self, unit: str) -> UnitStatus:
        """Return the link status of a unit; "not connected" while no reports on the unit arrive."""
        latest = self._latest[unit]
        if latest.beat is None:
            return NOT_REPORTED
        if self.is_alive(unit):
            return latest.status
        return replace(
            latest.status, state=LinkState.NOT_CONNECTED, reason=NOT_ANALYSED, since_ns=None
        )

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Raise `NotAvailableError`, since samples exist only in the process that analyses them."""
        raise NotAvailableError(f"live samples of unit {unit} are not available from this replica")

    def newest_block(self, unit: str) -> SampleBlock | None:  # noqa: ARG002  interface of LiveView
        """Return None, since samples exist only in the process that analyses them."""
        return None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return the reason why the newest samples of a unit are not current; None if current."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest block of a unit, s; None if unknown."""
        return self._age_s(unit, self._latest[unit].signs.data_age_s)

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return None without a result; else raise `NotAvailableError`: reports have no arrays."""
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

    The offset of two monotonic clocks is constant. The common delay of all reports is unobservable;
    reading the database twice a second keeps it below half a second.
    """

    def __init__(self) -> None:
        self._fastest: dict[str, tuple[float, float]] = {}

    def delay_s(self, process: str, sent_s: float | None, received_s: float) -> float:
        """Return the delay of a report relative to the fastest report of the process, s.

        Parameters
        ----------
        sent_s
            Send time by the monotonic clock of the reporting process, s; None if not reported.
        received_s
            Arrival time by the monotonic clock of this process, s.
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
    """Film state of a replica: verdicts from the reports, and baselines from the store."""

    def __init__(self, plant: PlantFile, store: FilmStore) -> None:
        self._store = store
        found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
        self._rules = {unit: rules for unit, rules in found.items() if isinstance(rules, FilmRules)}
        self.settings = plant.films
        self.unwatched = {unit: why for unit, why in found.items() if isinstance(why, str)}
        """Reason why the films of a unit are not monitored, by unit."""
        self._newest: dict[Key, FilmNews] = {}
        self._baselines: dict[Key, BearingBaseline] = {}

    def rules(self, unit: str) -> FilmRules | None:
        """Return the film rules of a unit; None if its films are not monitored."""
        return self._rules.get(unit)

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """Return a bearing and its stiffness estimator; None if its film is not monitored."""
        rules = self.rules(unit)
        if rules is None or bearing not in rules.estimators:
            return None
        return FilmPlace(unit, bearing, rules.estimators[bearing])

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest film reading of a bearing with its verdicts; None without one."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force for a bearing; None if no baseline is in force."""
        return self._baselines.get((unit, bearing))

    def fetch(self, unit: str, state: UnitState) -> Mapping[str, BearingBaseline]:
        """Return the baselines, by bearing, whose versions a reported unit state gives as in force.

        Baselines that are not in memory are read from the store, which blocks the thread. Raises
        `StoreError` if a baseline cannot be read.
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
        """Apply a reported unit state, and the baselines that `fetch` returned for this state."""
        for bearing, film in state.films.items():
            news = FilmNews(film.reading, film.findings, (INITIAL_DECISION, INITIAL_DECISION))
            self._newest[unit, bearing] = news
        others = {key: held for key, held in self._baselines.items() if key[0] != unit}
        self._baselines = others | {(unit, b): found for b, found in baselines.items()}


class ReplicaAlarms:
    """Alarms of a replica, from reports and the stored alarms.

    While a unit is not reported on, the conditions of its alarms are unknown.
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
        """Counter that increases if an alarm changes, or if reports on a unit stop or resume."""
        alive = {unit: self._is_alive(unit) for unit in self._judged}
        if alive != self._alive:  # a unit falls silent without a report
            self._alive = alive
            self._revision += 1
        return self._revision

    def take(self, unit: str, state: UnitState) -> None:
        """Apply the alarms of a reported unit state."""
        self._revision += 1
        self._judged[unit], self._chattering[unit] = state.judged, state.chattering
        # a process may still have alarms of units for which another process is now responsible
        self.take_stored(alarm for alarm in state.alarms if self._owner(alarm) == unit)

    def take_stored(self, alarms: Iterable[Alarm]) -> None:
        """Apply stored alarms that are at least as new as the alarms in memory."""
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
        """Return the alarm with an id; raise `LookupError` if it does not exist."""
        return self._alarms[id_]

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is known now, by the latest report."""
        unit = self._owner(alarm)
        return self._is_alive(unit) and alarm.identity.id in self._judged.get(unit, ())

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm is chattering, by the latest report."""
        return alarm.identity.id in self._chattering.get(self._owner(alarm), ())

    def owner(self, id_: str) -> str:
        """Return the unit whose process changes an alarm; raise `LookupError` for an unknown id."""
        return self._owner(self.alarm(id_))

    def _owner(self, alarm: Alarm) -> str:
        if is_shared(alarm):
            return SHARED
        unit = reporting_unit(alarm.identity)
        return unit if unit in self._units else PLANT

    def count(self) -> AlarmCount:
        """Return the numbers of active, unacknowledged, hidden and unjudged alarms."""
        return count_of(self.alarms, self.is_judged)
