"""Snapshot of the state of a unit when an alarm is raised, kept in memory until it is written."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.alarms.alarm import AlarmEvent
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from service.live.status import UnitStatus


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
