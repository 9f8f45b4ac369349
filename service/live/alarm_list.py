"""`AlarmList`: list of alarms for API, metrics and reports, and its counts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmState
from core.alarms.statistics import ChatterRule
from core.limits import AlarmLevel

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class AlarmCount:
    """Number of alarms by state.

    Parameters
    ----------
    n_active
        Number of active alarms that are not hidden.
    n_danger
        Number of active alarms at danger level that are not hidden.
    n_unacknowledged
        Number of alarms that are not hidden, with an unacknowledged newest occurrence.
    n_hidden
        Number of alarms that are shelved, suppressed or out of service.
    n_unjudged
        Number of alarms neither active nor hidden, without a current condition.
    """

    n_active: int
    n_danger: int
    n_unacknowledged: int
    n_hidden: int
    n_unjudged: int


def count_of(alarms: Sequence[Alarm], is_judged: Callable[[Alarm], bool]) -> AlarmCount:
    """Return the number of alarms by state."""
    shown = [alarm for alarm in alarms if alarm.state not in HIDDEN]
    return AlarmCount(
        n_active=sum(alarm.level is not None for alarm in shown),
        n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in shown),
        n_unacknowledged=sum(not alarm.is_acknowledged for alarm in shown),
        n_hidden=len(alarms) - len(shown),
        n_unjudged=sum(a.level is None and not is_judged(a) for a in shown),
    )


class AlarmList(Protocol):
    """List of all alarms, from `AlarmEngine` in this process or from states of other processes."""

    @property
    def revision(self) -> int:
        """Revision number; changes with every change of an alarm."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """Definition of chattering alarms."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, in any state."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id. Raises `LookupError` if it does not exist."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is currently known."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm was raised too often recently."""
        ...

    def count(self) -> AlarmCount:
        """Return the number of alarms by state."""
        ...


@dataclass(frozen=True)
class EvidenceStatus:
    """Number of evidence bundles since the start, and the present write error or None."""

    error: str | None
    n_waiting: int
    n_written: int
    n_lost: int
