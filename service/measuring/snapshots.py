"""Snapshots of units, built from the parts of the measuring process, and the reports on them."""

from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import fields

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


class Reports:
    """Builder of the reports of a process, with what changed since the previous report.

    `held` returns the ids of the units to report now, also `PLANT` and `SHARED`; `plant` returns
    the state of the process, None if it is not reported.
    """

    def __init__(
        self,
        process: str,
        held: Callable[[], Iterable[str]],
        units: Sequence[UnitSettings],
        live: LiveView,
        alarms: AlarmEngine,
        films: FilmMonitor,
        plant: Callable[[], PlantSnapshot | None] = lambda: None,
    ) -> None:
        self._process, self._held, self._plant = process, held, plant
        self._bearings = {unit.id: [each.id for each in unit.bearing] for unit in units}
        self._live, self._alarms, self._films = live, alarms, films
        self._sent: dict[str, tuple[int, UnitSnapshot]] = {}
        self._sent_plant: PlantSnapshot | None = None
        self._n_reports = 0

    def report(self, is_first: bool) -> Report:
        """Return a report on all units; it has only changed snapshots unless `is_first`.

        The revision of a snapshot is the number of the report in which it was new.
        """
        if is_first:
            self._sent, self._sent_plant = {}, None
        self._n_reports += 1
        chattering, common = self._alarms.chattering, defaultdict[str, list[Alarm]](list)
        for alarm in self._alarms.common_alarms:
            common[owner_of(alarm, self._bearings)].append(alarm)
        before, self._sent, units = self._sent, {}, []
        for unit in self._held():
            snapshot, sent = self._snapshot(unit, common[unit], chattering), before.get(unit)
            # fast, because unchanged parts are the same objects
            is_same = sent is not None and snapshot == sent[1]
            self._sent[unit] = sent if sent and is_same else (self._n_reports, snapshot)
            revision, news = self._sent[unit][0], None if is_same else snapshot
            units.append(UnitReport(unit, self._live.link(unit), revision, news))
        plant_before, self._sent_plant = self._sent_plant, self._plant()
        plant = None if self._sent_plant == plant_before else self._sent_plant
        return Report(self._process, self._n_reports, tuple(units), plant)

    def _snapshot(
        self, unit: str, common: Iterable[Alarm], chattering: Container[str]
    ) -> UnitSnapshot:
        """Return the present state of a unit, or the alarms of `PLANT` or `SHARED`.

        `common` are the alarms of no unit that the report on this unit contains, `chattering` the
        ids of all chattering alarms.
        """
        bearings, own = self._bearings.get(unit, []), self._alarms.units.get(unit)
        alarms = (*(own.alarms if own else ()), *common)
        found = {bearing: self._live.assessment(unit, bearing) for bearing in bearings}
        read = {bearing: self._films.newest(unit, bearing) for bearing in bearings}
        in_force = {bearing: self._films.baseline(unit, bearing) for bearing in bearings}
        return UnitSnapshot(
            bearings={bearing: bearing_snapshot(each) for bearing, each in found.items() if each},
            alarms=alarms,
            judged=frozenset(a.identity.id for a in alarms if self._alarms.is_judged(a)),
            chattering=frozenset(a.identity.id for a in alarms if a.identity.id in chattering),
            films={bearing: news for bearing, news in read.items() if news},
            baselines={b: baseline.origin.version for b, baseline in in_force.items() if baseline},
        )
