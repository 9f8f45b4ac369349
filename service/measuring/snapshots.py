"""Snapshots of units, built from the parts of the measuring process, and the reports on them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace

from core.alarms.alarm import Alarm
from core.monitor.assessment import Assessment, BearingResult
from service.live.alarm_list import owner_of
from service.live.snapshot import PlantSnapshot, Report, UnitReport, UnitSnapshot
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.settings.units import UnitSettings

RESULTS = [each.name for each in fields(BearingResult)]


def bearing_snapshot(assessment: Assessment) -> BearingResult:
    """Return a result of a bearing without its arrays (spectrum, orbit)."""
    return BearingResult(**{name: getattr(assessment, name) for name in RESULTS})


class SnapshotBuilder:
    """Builder of snapshots of units, with a revision number for each unit."""

    def __init__(
        self,
        units: Sequence[UnitSettings],
        live: LiveView,
        alarms: AlarmEngine,
        films: FilmMonitor,
    ) -> None:
        self._bearings = {unit.id: [each.id for each in unit.bearing] for unit in units}
        self._live, self._alarms, self._films = live, alarms, films
        self._built: dict[str, tuple[int, UnitSnapshot | None]] = {}

    def report(self, unit: str) -> UnitReport:
        """Return the present state of a unit, or the alarms of `PLANT` or `SHARED`."""
        bearings, alarms = self._bearings.get(unit, []), self._alarms_of(unit)
        found = {bearing: self._live.assessment(unit, bearing) for bearing in bearings}
        read = {bearing: self._films.newest(unit, bearing) for bearing in bearings}
        in_force = {bearing: self._films.baseline(unit, bearing) for bearing in bearings}
        judged, chattering = self._alarms.is_judged, self._alarms.is_chattering
        snapshot = UnitSnapshot(
            bearings={bearing: bearing_snapshot(each) for bearing, each in found.items() if each},
            alarms=tuple(alarms),
            judged=frozenset(a.identity.id for a in alarms if judged(a)),
            chattering=frozenset(a.identity.id for a in alarms if chattering(a)),
            films={bearing: news for bearing, news in read.items() if news},
            baselines={b: baseline.origin.version for b, baseline in in_force.items() if baseline},
        )
        revision, built = self._built.get(unit, (0, None))
        if snapshot != built:  # fast, because unchanged parts are the same objects
            revision += 1
            self._built[unit] = revision, snapshot
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
