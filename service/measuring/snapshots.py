"""Snapshots of units, built from the parts of the measuring process, and the reports on them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from core.monitor.assessment import Assessment
from service.live.alarm_list import owner_of
from service.live.snapshot import (
    BearingSnapshot,
    PlantSnapshot,
    Report,
    UnitLink,
    UnitReport,
    UnitSnapshot,
)
from service.live.status import UnitStatus
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.settings.units import UnitSettings

LINK_EVERY_S = 1.0
"""Period of reports on the link of a unit, s: a unit without reports counts as not analysed."""

REBUILT_EVERY_S = 5.0
"""Maximum delay, s, until a snapshot shows that an alarm has ceased to chatter."""


def bearing_snapshot(assessment: Assessment) -> BearingSnapshot:
    """Return a result of a bearing without its arrays (spectrum, orbit)."""
    names = [each.name for each in fields(BearingSnapshot)]
    return BearingSnapshot(**{name: getattr(assessment, name) for name in names})


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
        return UnitReport(unit, self._link(unit), revision, snapshot)

    def _alarms_of(self, unit: str) -> list[Alarm]:
        """Return the alarms that a report on a unit contains."""
        common = self._alarms.common_alarms
        of_unit = self._alarms.units[unit].alarms if unit in self._bearings else []
        return [*of_unit, *(each for each in common if owner_of(each, self._bearings) == unit)]

    def _link(self, unit: str) -> UnitLink:
        """Return a unit's link state and data ages, if measured here, and the process's faults."""
        live = self._live
        faults = (live.store_error, self._clock.monotonic_s())
        if unit not in self._bearings:
            return UnitLink(UnitStatus(), None, {}, *faults)
        ages_s = {bearing: live.result_age_s(unit, bearing) for bearing in self._bearings[unit]}
        known = {bearing: age_s for bearing, age_s in ages_s.items() if age_s is not None}
        stored = live.stored(unit)
        return UnitLink(live.status(unit), live.data_age_s(unit), known, *faults, stored=stored)


@dataclass
class SocketReports:
    """Builder of reports for the serving process, on the changes since the previous report.

    `units` are the ids of all reported units, with `PLANT` and `SHARED`; `plant` returns the state
    of the measuring process.
    """

    units: Sequence[str]
    builder: SnapshotBuilder
    plant: Callable[[], PlantSnapshot]
    clock: Clock
    _n_reports: int = field(default=0, init=False)
    _sent: dict[str, tuple[int, object, float]] = field(default_factory=dict, init=False)
    _sent_plant: PlantSnapshot | None = field(default=None, init=False)

    def report(self, is_first: bool) -> Report | None:
        """Return a report on all changes, or on everything if `is_first`; None without changes."""
        if is_first:
            self._sent, self._sent_plant = {}, None
        now_s = self.clock.monotonic_s()
        found = [each for unit in self.units if (each := self._unit(unit, now_s)) is not None]
        plant = self.plant()
        is_new = plant != self._sent_plant
        if not found and not is_new:
            return None
        self._n_reports, self._sent_plant = self._n_reports + 1, plant
        return Report("measuring", self._n_reports, tuple(found), plant if is_new else None)

    def _unit(self, unit: str, now_s: float) -> UnitReport | None:
        newest = self.builder.report(unit)
        status, link = newest.link.status, newest.link
        state = (status.state, status.reason, status.last_sample_ns, link.stored, link.store_error)
        sent_revision, sent_state, sent_s = self._sent.get(unit, (0, None, 0.0))
        is_new = newest.revision != sent_revision
        if not is_new and state == sent_state and now_s - sent_s < LINK_EVERY_S:
            return None
        self._sent[unit] = (newest.revision, state, now_s)
        return newest if is_new else replace(newest, snapshot=None)
