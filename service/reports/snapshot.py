"""`Snapshot`: what was known when an alarm was raised, held by reference until it is written."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.alarms.alarm import AlarmEvent
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from service.live.live_view import LiveView, UnitStatus
from service.measuring.films import FilmKeeper
from service.settings.units import UnitSettings


@dataclass(frozen=True)
class BearingSnapshot:
    """What was known of one bearing; None where there was nothing."""

    assessment: Assessment | None
    film: FilmNews | None
    baseline: BearingBaseline | None


@dataclass(frozen=True)
class Snapshot:
    """What was known at one moment; values that never change, none of them copied.

    Parameters
    ----------
    taken_ns
        Host time.
    status
        How samples of the unit arrived; None for the service itself.
    bearings
        All of the unit, that of the alarm first.
    bearing
        That of the alarm, if it is about one.
    rules
        How films are watched; None if they are not.
    samples_expected
        Whether samples around the alarm are going to be kept.
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
        """The occurrence, for messages."""
        return f"{self.event.identity.id} occurrence {self.event.occurrence}"


class SnapshotTaker:
    """Takes snapshots on the event loop; works in no time, since it only takes references."""

    def __init__(
        self, units: Mapping[str, UnitSettings], live: LiveView, films: FilmKeeper
    ) -> None:
        self._units, self._live, self._films = units, live, films

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Snapshot:
        """Note what is known of an alarm's unit now."""
        id_, unit = event.identity.unit, self._units.get(event.identity.unit)
        bearing = None if unit is None else bearing_of(unit, event.identity.subject)
        ids = [] if unit is None else [each.id for each in unit.bearing]
        ids.sort(key=lambda each: each != bearing)  # the others stay in their order
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
    """The bearing that an alarm's subject is, or one of whose channels it is."""
    for bearing in unit.bearing:
        channels = {bearing.shaft_x, bearing.shaft_y, bearing.bearing_x, bearing.bearing_y}
        if subject == bearing.id or subject in channels:
            return bearing.id
    for bearing in unit.bearing:
        others = (bearing.oil_temperature, bearing.gap_x, bearing.gap_y)
        if subject in (*others, bearing.opposite_x, bearing.opposite_y):
            return bearing.id
    return None
