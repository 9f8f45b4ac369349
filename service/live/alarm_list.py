"""List of alarms as API, metrics and reports read it, and its counts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmState
from core.alarms.statistics import ChatterRule
from core.limits import AlarmLevel

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class AlarmCount:
    """Number of alarms on the list.

    Parameters
    ----------
    n_active
        Active and not hidden.
    n_danger
        Active and not hidden, at danger level.
    n_unacknowledged
        Active or returned, not hidden, with an unacknowledged newest occurrence.
    n_hidden
        Shelved, suppressed or out of service.
    n_unjudged
        Neither active nor hidden, without a current condition.
    """

    n_active: int
    n_danger: int
    n_unacknowledged: int
    n_hidden: int
    n_unjudged: int


def count_of(alarms: Sequence[Alarm], is_judged: Callable[[Alarm], bool]) -> AlarmCount:
    """Count alarms of any state."""
    shown = [alarm for alarm in alarms if alarm.state not in HIDDEN]
    return AlarmCount(
        n_active=sum(alarm.level is not None for alarm in shown),
        n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in shown),
        n_unacknowledged=sum(not alarm.is_acknowledged for alarm in shown),
        n_hidden=len(alarms) - len(shown),
        n_unjudged=sum(a.level is None and not is_judged(a) for a in shown),
    )


class AlarmList(Protocol):
    """All alarms, from `AlarmEngine` in this process or from the reports of others."""

    @property
    def revision(self) -> int:
        """Number that changes with every change of an alarm."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """Definition of chattering alarms."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms of any state."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Return an alarm. Raises `LookupError` if it does not exist."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is known now."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm was raised too often recently."""
        ...

    def count(self) -> AlarmCount:
        """Return the number of alarms."""
        ...


@dataclass(frozen=True)
class EvidenceStatus:
    """Number of evidence bundles since the start, and why none is written now, if so."""

    error: str | None
    n_waiting: int
    n_written: int
    n_lost: int
