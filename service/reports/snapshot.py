"""Snapshot of the state of a unit when an alarm is raised, kept in memory until it is written."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.alarms.alarm import AlarmEvent
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from service.live.live_view import LiveView, UnitStatus
from service.measuring.films import FilmMonitor
from service.settings.units import UnitSettings


@dataclass(frozen=True)
class BearingSnapshot:
    """State of a bearing: newest assessment, film reading and baseline; None if missing."""

    assessment: Assessment | None
    film: FilmNews | None
    baseline: BearingBaseline | None


@dataclass(frozen=True)
class Snapshot:
    """State of a unit at the time of an alarm; references to immutable values, without copies.

    Parameters
    ----------
    event
        Event that raised or escalated the alarm.
    taken_ns
        Host time of the snapshot, in nanoseconds since 1970 UTC.
    status
        State of the link and of the samples of the unit; None for alarms about the service.
    bearings
        State of all bearings of the unit; the bearing of the alarm comes first.
    bearing
        Identifier of the bearing of the alarm; None if the alarm concerns no bearing.
    rules
        Rules of film monitoring; None if film monitoring is off.
    samples_expected
        Whether the samples around the alarm are to be recorded.
    """

    event: AlarmEvent
    taken_ns: int
    status: UnitStatus | None
    bearings: Mapping[str, BearingSnapshot]
    bearing: str | None
    rules: FilmRules | None
    samples_expected: bool

    @property
    def name(self) -> str:
        """Alarm id and occurrence, for messages."""
        return f"{self.event.identity.id} occurrence {self.event.occurrence}"


class SnapshotTaker:
    """Takes snapshots on the event loop without blocking, as only references are copied."""

    def __init__(
        self, units: Mapping[str, UnitSettings], live: LiveView, films: FilmMonitor
    ) -> None:
        self._units, self._live, self._films = units, live, films

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Snapshot:
        """Return a snapshot of the unit of an alarm event."""
        id_, unit = event.identity.unit, self._units.get(event.identity.unit)
        bearing = None if unit is None else bearing_of(unit, event.identity.subject)
        ids = [] if unit is None else [each.id for each in unit.bearing]
        ids.sort(key=lambda each: each != bearing)  # stable: the others keep their order
        return Snapshot(
            event=event,
            taken_ns=now_ns,
            status=None if unit is None else self._live.status(id_),
            bearings={each: self._bearing(id_, each) for each in ids},
            bearing=bearing,
            rules=self._films.rules(id_),
            samples_expected=samples_expected,
        )

    def _bearing(self, unit: str, bearing: str) -> BearingSnapshot:
        return BearingSnapshot(
            self._live.assessment(unit, bearing),
            self._films.newest(unit, bearing),
            self._films.baseline(unit, bearing),
        )


def bearing_of(unit: UnitSettings, subject: str) -> str | None:
    """Return the bearing of an alarm subject, a bearing or one of its channels; None if unknown."""
    for bearing in unit.bearing:
        channels = {bearing.shaft_x, bearing.shaft_y, bearing.bearing_x, bearing.bearing_y}
        if subject == bearing.id or subject in channels:
            return bearing.id
    for bearing in unit.bearing:
        others = (bearing.oil_temperature, bearing.gap_x, bearing.gap_y)
        if subject in (*others, bearing.opposite_x, bearing.opposite_y):
            return bearing.id
    return None
