"""Snapshots of units, built from the parts of the measuring process, and the reports on them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from core.monitor.assessment import Assessment, BearingResult
from service.live.alarm_list import owner_of
from service.live.snapshot import PlantSnapshot, Report, UnitReport, UnitSnapshot
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.settings.units import UnitSettings

REBUILT_EVERY_S = 5.0
"""Maximum delay, s, until a snapshot shows that an alarm has ceased to chatter."""


def bearing_snapshot(assessment: Assessment) -> BearingResult:
    """Return a result of a bearing without its arrays (spectrum, orbit)."""
    names = [each.name for each in fields(BearingResult)]
    return BearingResult(**{name: getattr(assessment, name) for name in names})


class SnapshotBuilder:
    """Builder of snapshots of units; it builds a snapshot again only after a change of the unit."""

    def __init__(
        self,
        units: Sequence[UnitSettings],
        live: LiveView,
        alarms: AlarmEngine,
        films: FilmMonitor,
        clock: Clock,
    ) -> None:
        self._bearings = {unit.id: [each.id for each in unit.bearing] for unit in units}
        self._live, self._alarms, self._films, self._clock = live, alarms, films, clock
        self._built: dict[str, tuple[object, int, UnitSnapshot | None]] = {}

    def report(self, unit: str) -> UnitReport:
        """Return the present state of a unit, or the alarms of `PLANT` or `SHARED`."""
        bearings, alarms = self._bearings.get(unit, []), self._alarms_of(unit)
        is_unit = unit in self._bearings
        own = (self._live.revision(unit), self._alarms.units[unit].is_connected) if is_unit else ()
        read = {bearing: self._films.newest(unit, bearing) for bearing in bearings}
        films = {bearing: news for bearing, news in read.items() if news}
        in_force = {bearing: self._films.baseline(unit, bearing) for bearing in bearings}
        versions = {bearing: found.origin.version for bearing, found in in_force.items() if found}
        round_ = self._clock.monotonic_s() // REBUILT_EVERY_S
        key = (own, alarms, films, versions, round_)
        built_key, revision, snapshot = self._built.get(unit, (None, 0, None))
        if snapshot is None or built_key != key:
            found = {bearing: self._live.assessment(unit, bearing) for bearing in bearings}
            judged, chattering = self._alarms.is_judged, self._alarms.is_chattering
            newest = UnitSnapshot(
                bearings={b: bearing_snapshot(result) for b, result in found.items() if result},
                alarms=tuple(alarms),
                judged=frozenset(a.identity.id for a in alarms if judged(a)),
                chattering=frozenset(a.identity.id for a in alarms if chattering(a)),
                films=films,
                baselines=versions,
            )
            if newest != snapshot:
                revision, snapshot = revision + 1, newest
            self._built[unit] = key, revision, snapshot
        return UnitReport(unit, self._live.link(unit), revision, snapshot)

    def _alarms_of(self, unit: str) -> list[Alarm]:
        """Return the alarms that a report on a unit contains."""
        common = self._alarms.common_alarms
        of_unit = self._alarms.units[unit].alarms if unit in self._bearings else []
        return [*of_unit, *(each for each in common if owner_of(each, self._bearings) == unit)]


@dataclass
class Reports:
    """Builder of the reports of a process, with what changed since the previous report.

    `units` returns the ids of the units to report now, also `PLANT` and `SHARED`; `plant` returns
    the state of the process, None if it is not reported.
    """

    process: str
    units: Callable[[], Iterable[str]]
    builder: SnapshotBuilder
    plant: Callable[[], PlantSnapshot | None] = lambda: None
    _n_reports: int = field(default=0, init=False)
    _sent: dict[str, int] = field(default_factory=dict, init=False)
    _sent_plant: PlantSnapshot | None = field(default=None, init=False)

    def report(self, is_first: bool) -> Report:
        """Return a report on all units; it has only changed snapshots unless `is_first`."""
        if is_first:
            self._sent, self._sent_plant = {}, None
        found, plant = [self.builder.report(unit) for unit in self.units()], self.plant()
        units = tuple(
            replace(each, snapshot=None) if self._sent.get(each.unit) == each.revision else each
            for each in found
        )
        report = Report(self.process, self._n_reports + 1, units, plant)
        if plant == self._sent_plant:
            report = replace(report, plant=None)
        self._sent = {each.unit: each.revision for each in found}
        self._n_reports, self._sent_plant = report.number, plant
        return report
