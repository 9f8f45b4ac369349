"""Present state of units and films in the serving process, from received reports."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import LeastDelay
from core.alarms.alarm import PLANT
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment, BearingResult
from core.quality import Reason
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S, ns_from_s
from service.live.alarm_list import SHARED
from service.live.commands import FilmPlace, NotAvailableError
from service.live.exchange import MeasuringGoneError
from service.live.references import Key
from service.live.snapshot import UnitLink, UnitSnapshot
from service.live.status import (
    CurrentBearing,
    LinkState,
    UnitStatus,
    current_bearing,
    why_not_current,
)
from service.settings.core_values import film_rules_of
from service.settings.plant import PlantFile
from service.store.films import FilmStore
from service.store.port import StoreError

log = structlog.get_logger()

MAX_DRIFT = 1e-3
"""Upper bound of the relative drift of two monotonic clocks."""

SILENT_AFTER_S = 5.0
"""Age of the last report, s, above which a unit counts as not analysed; the period is 1 s."""

CHECK_S = 0.2
"""Time after which units without new reports are looked at again for stale results, s."""

NOT_ANALYSED = "no process is analysing this unit"

NO_LINK = UnitLink(UnitStatus(), None, {}, 0.0)


@dataclass(frozen=True)
class LatestReport:
    """Latest report on a unit.

    Parameters
    ----------
    beat
        Process and sequence number of the report; None before the first report.
    sent_s
        Time at which the report was sent, by the monotonic clock of this process, s. None for the
        first report of a process, whose age is unknown.
    link
        Link of the unit, with the arrival time of its newest block, valid while reports arrive.
    results
        Newest result of each bearing, by bearing id.
    received_ns
        Arrival time of the samples of each result by the host clock of this process, UTC
        nanoseconds since 1970, by bearing id; without the results whose age is unknown.
    """

    beat: tuple[str, int] | None = None
    sent_s: float | None = None
    link: UnitLink = NO_LINK
    results: Mapping[str, BearingResult] = field(default_factory=dict)
    received_ns: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def times_ns(self) -> Mapping[str, int]:
        """Time of each result, ns since 1970 UTC, by bearing id."""
        return {bearing: result.time_ns for bearing, result in self.results.items()}


Ask = Callable[[str, str], Awaitable[Any]]
"""Function that asks the measuring process a question of a kind, with its arguments as JSON."""


class LiveUnits:
    """State of all units from their latest reports; outdated values do not count as current.

    Ages count from the send time of a report, by the monotonic clock of this process: the arrival
    minus the estimated delay. The clocks of the hosts need not agree, and the delay of a report by
    the database does not reduce the ages of its values.

    `ask` is a coroutine function that sends a question to the measuring process, such as for the
    newest samples, and returns the answer; its arguments are the kind of question and a JSON
    document. None if this process has no connection to the measuring process.
    """

    def __init__(
        self, units: Iterable[str], clock: Clock, stale_after_s: float, ask: Ask | None = None
    ) -> None:
        self._clock, self._stale_after_s, self._ask = clock, stale_after_s, ask
        self._delays: dict[str, LeastDelay] = {}
        self._latest = dict.fromkeys((*units, PLANT, SHARED), LatestReport())
        self._revisions = dict.fromkeys(self._latest, 0)
        self._seen: dict[str, object] = {}
        self._asked: dict[tuple[str, ...], tuple[object, asyncio.Future[Any]]] = {}
        self.n_reports = 0
        """Number of applied reports."""
        self.read_error: str | None = None
        """Error of the newest attempt to read the reports; None if the attempt succeeded."""

    @property
    def units(self) -> Sequence[str]:
        """All units of the plant, and the pseudo-units `PLANT` and `SHARED`."""
        return tuple(self._latest)

    def revision(self, unit: str) -> int:
        """Return a counter that increases with every change of a unit's link and results.

        A result that becomes outdated is a change; new samples and greater ages are not.
        """
        latest, status = self._latest[unit], self.status(unit)
        ages_s = (self._age_s(unit, latest.link.result_ages_s.get(b)) for b in latest.results)
        current = [self._why_not_current(unit, age_s) is None for age_s in ages_s]
        link = (status.state, status.reason, status.since_ns)
        seen = (latest.times_ns, latest.received_ns, current, link)
        if seen != self._seen.get(unit):
            self._seen[unit] = seen
            self._revisions[unit] += 1
        return self._revisions[unit]

    def update(
        self, unit: str, process: str, n_beats: int, link: UnitLink, *, is_direct: bool = False
    ) -> None:
        """Apply the latest report on a unit; a report that was applied before has no effect.

        `n_beats` is the sequence number of the report in its `process`. With `is_direct`, the
        report comes directly from the process, so that the age of a first report is known;
        otherwise it was read from the database.
        """
        latest, beat = self._latest[unit], (process, n_beats)
        if latest.beat == beat:
            return
        now_s = self._clock.monotonic_s()
        # The delay is relative to the fastest report of the process, because the offset of the two
        # monotonic clocks is constant. The common delay of all reports is unobservable; reading the
        # database twice a second keeps it below half a second.
        delay = self._delays.setdefault(process, LeastDelay(MAX_DRIFT))
        delay_s = max(0.0, delay.late_s(now_s - link.said_s, now_s))
        is_first = latest.beat is None or latest.beat[0] != process
        sent_s = None if is_first and not is_direct else now_s - delay_s
        received_ns = latest.received_ns
        if sent_s is not None:
            sent_ns = self._clock.now_ns() - ns_from_s(delay_s)
            ages_s = link.result_ages_s.items()
            # the arrival time of a result stays the same, although reports differ in their delays
            found_ns = {b: sent_ns - ns_from_s(age_s) for b, age_s in ages_s}
            received_ns = {**found_ns, **received_ns}
            if link.data_age_s is not None:
                data_ns = sent_ns - ns_from_s(link.data_age_s)
                link = replace(link, status=replace(link.status, received_ns=data_ns))
        self.n_reports += 1
        self._latest[unit] = replace(
            latest, beat=beat, sent_s=sent_s, link=link, received_ns=received_ns
        )

    def set_results(self, unit: str, results: Mapping[str, BearingResult]) -> None:
        """Set the newest results of a unit, by bearing id."""
        latest = self._latest[unit]
        same = {b for b, each in results.items() if latest.times_ns.get(b) == each.time_ns}
        received_ns = {b: then_ns for b, then_ns in latest.received_ns.items() if b in same}
        self._latest[unit] = replace(latest, results=results, received_ns=received_ns)

    def past_revision(self, unit: str, end_ns: int) -> Hashable:
        """Return a value that changes with the stored results of a unit before a time.

        Results are stored in order of time: those older than the newest stored result change only
        by retention, so the present hour is their revision. A process that takes over a unit
        counts its writes from zero, and an ended process may have stored results without a
        report on them.
        """
        latest = self._latest[unit]
        stored = latest.link.stored
        if end_ns < stored.newest_ns:
            return "closed", self._clock.now_ns() // (3600 * NS_PER_S)
        return latest.beat and latest.beat[0], stored, self.is_alive(unit)

    def silence_s(self, unit: str) -> float | None:
        """Return the time since the last report on a unit, s; None before a report of known age."""
        sent_s = self._latest[unit].sent_s
        return None if sent_s is None else self._clock.monotonic_s() - sent_s

    def is_alive(self, unit: str) -> bool:
        """Return whether the age of the last report on the unit is at most `SILENT_AFTER_S` s."""
        sent_s = self._latest[unit].sent_s  # asked for all units at each poll of a page
        return sent_s is not None and self._clock.monotonic_s() - sent_s <= SILENT_AFTER_S

    @property
    def store_error(self) -> str | None:
        """Error of reading reports, else store error of a reporting process; None without error."""
        errors = (self._latest[u].link.store_error for u in self._latest if self.is_alive(u))
        return self.read_error or next((error for error in errors if error), None)

    def status(self, unit: str) -> UnitStatus:
        """Return the link status of a unit; "not connected" while no reports on the unit arrive."""
        status = self._latest[unit].link.status
        if self.is_alive(unit):
            return status
        return replace(status, state=LinkState.NOT_CONNECTED, reason=NOT_ANALYSED, since_ns=None)

    @property
    def can_ask(self) -> bool:
        """Whether live samples, spectra and orbits are available from this process."""
        return self._ask is not None

    async def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Return the newest blocks of a unit, oldest first; they may be out of date.

        Raises `NotAvailableError` if the process that analyses the unit cannot be asked.
        """
        blocks: Sequence[SampleBlock]
        blocks = await self._answer(self._latest[unit].beat, "blocks", unit)
        return blocks

    async def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return the newest result of a bearing with spectrum and orbit; None before the first.

        Raises `NotAvailableError` if the process that analyses the unit cannot be asked.
        """
        known = self._latest[unit].results.get(bearing)
        if known is None:
            return None
        found: Assessment | None = await self._answer(known.time_ns, "result", unit, bearing)
        return found

    async def _answer(self, fresh: object, kind: str, *which: str) -> Any:
        """Return an answer of the measuring process, shared by all who ask while it is fresh."""
        if self._ask is None:
            raise NotAvailableError(
                f"live samples, spectra and orbits of unit {which[0]} exist only in the process"
                " that analyses it; spectra over time are available here"
            )
        held = self._asked.get((kind, *which))
        if held is None or held[0] != fresh:
            asking = asyncio.ensure_future(self._ask(kind, json.dumps(which)))
            held = self._asked[kind, *which] = (fresh, asking)
        try:
            return await asyncio.shield(held[1])
        except MeasuringGoneError as error:
            self._asked.pop((kind, *which), None)
            raise NotAvailableError(f"{kind} of unit {which[0]}: {error}") from error

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return the reason why the newest samples of a unit are outdated; None if they are not."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest block of a unit, s; None if unknown."""
        return self._age_s(unit, self._latest[unit].link.data_age_s)

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result of a bearing; its readings are missing if it is not current."""
        latest = self._latest[unit]
        age_s = self._age_s(unit, latest.link.result_ages_s.get(bearing))
        why_not = self._why_not_current(unit, age_s)
        received_ns = latest.received_ns.get(bearing)
        return current_bearing(latest.results.get(bearing), age_s, why_not, received_ns)

    def _age_s(self, unit: str, then_s: float | None) -> float | None:
        silence_s = self.silence_s(unit)
        return None if then_s is None or silence_s is None else then_s + silence_s

    def _why_not_current(self, unit: str, age_s: float | None) -> Reason | None:
        return why_not_current(self.status(unit).state, age_s, self._stale_after_s)


class LiveFilms:
    """State of the oil films: verdicts from the reports, and baselines from the store."""

    def __init__(self, plant: PlantFile, store: FilmStore) -> None:
        self._store = store
        found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
        self._rules = {unit: rules for unit, rules in found.items() if isinstance(rules, FilmRules)}
        self.settings = plant.films
        self.grid = plant.films.baseline.settings().grid
        """Grid of the cells of operating conditions, common to all units."""
        self.unwatched = {unit: why for unit, why in found.items() if isinstance(why, str)}
        """Reason why the films of a unit are not monitored, by unit."""
        self.n_taken = 0
        """Number of updates by snapshots of units."""
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
        """Return the newest film reading of a bearing with its verdicts; None before the first."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force for a bearing; None if no baseline is in force."""
        return self._baselines.get((unit, bearing))

    async def take(self, unit: str, state: UnitSnapshot) -> None:
        """Update the films of a unit from its snapshot; new baselines are read from the store.

        A baseline that the store does not have or that cannot be read is left out; the latter is
        logged. The state changes after the last read.
        """
        found = {}
        for bearing, version in state.baselines.items():
            baseline = self.baseline(unit, bearing)
            if baseline is None or baseline.origin.version != version:
                try:
                    baseline = await asyncio.to_thread(self._store.baseline, unit, bearing, version)
                except StoreError as error:
                    log.error("baselines cannot be read", unit=unit, reason=str(error))
                    continue
            if baseline is not None:
                found[unit, bearing] = baseline
        self.n_taken += 1
        self._newest |= {(unit, bearing): news for bearing, news in state.films.items()}
        others = {key: held for key, held in self._baselines.items() if key[0] != unit}
        self._baselines = others | found
