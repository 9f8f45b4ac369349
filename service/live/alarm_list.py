"""`AlarmList`: list of all alarms for API, metrics and reports, and numbers of alarms by state."""

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
        Number of alarms that are not hidden and whose newest occurrence is not acknowledged.
    n_hidden
        Number of alarms that are shelved, suppressed or out of service.
    n_unjudged
        Number of alarms that are neither active nor hidden, and whose condition is now unknown.
    """

    n_active: int
    n_danger: int
    n_unacknowledged: int
    n_hidden: int
    n_unjudged: int


def count_of(alarms: Sequence[Alarm], is_judged: Callable[[Alarm], bool]) -> AlarmCount:
    """Return the number of alarms by state; `is_judged` as in `AlarmList`."""
    shown = [alarm for alarm in alarms if alarm.state not in HIDDEN]
    return AlarmCount(
        n_active=sum(alarm.level is not None for alarm in shown),
        n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in shown),
        n_unacknowledged=sum(not alarm.is_acknowledged for alarm in shown),
        n_hidden=len(alarms) - len(shown),
        n_unjudged=sum(a.level is None and not is_judged(a) for a in shown),
    )


class AlarmList(Protocol):
    """List of all alarms, from `AlarmEngine` in this process or states of other processes."""

    @property
    def revision(self) -> int:
        """Revision number of the list; changes whenever an alarm changes."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """Number of occurrences within a time that makes an alarm count as chattering."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms in all states, including hidden ones."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id. Raises `LookupError` if it does not exist."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is currently known to be true or false."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm was recently raised too often, by `chatter_rule`."""
        ...

    def count(self) -> AlarmCount:
        """Return the number of alarms by state."""
        ...


@dataclass(frozen=True)
class EvidenceStatus:
    """Numbers of evidence bundles since the service started; present write error or None."""

    error: str | None
    n_waiting: int
    n_written: int
    n_lost: int
