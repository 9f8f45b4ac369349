"""`AlarmList`: list of all alarms for API, metrics and reports, and numbers of alarms by state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmState
from core.alarms.statistics import ChatterRule
from core.limits import AlarmLevel
from service.settings.alarm_kinds import ANALYSIS_GONE, SAMPLES_LOST

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class AlarmCount:
    """Numbers of alarms by state.

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
    """Return the numbers of alarms by state; `is_judged` as in `AlarmList`."""
    shown = [alarm for alarm in alarms if alarm.state not in HIDDEN]
    return AlarmCount(
        n_active=sum(alarm.level is not None for alarm in shown),
        n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in shown),
        n_unacknowledged=sum(not alarm.is_acknowledged for alarm in shown),
        n_hidden=len(alarms) - len(shown),
        n_unjudged=sum(a.level is None and not is_judged(a) for a in shown),
    )


class AlarmList(Protocol):
    """List of all alarms: the `AlarmEngine` of this process, or reports of other processes."""

    @property
    def revision(self) -> int:
        """Revision number of the list; changes whenever an alarm changes."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """Number of occurrences, and the time within which they make an alarm chattering."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms in all states, including hidden ones."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id; raise `LookupError` if it does not exist."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is known now."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm was recently raised too often, by `chatter_rule`."""
        ...

    def count(self) -> AlarmCount:
        """Return the numbers of alarms by state."""
        ...


SHARED = "shared work"
"""Name used instead of a unit in reports and commands about shared alarms; not a valid unit id."""


def is_shared(alarm: Alarm) -> bool:
    """Return whether an alarm belongs to the process that runs the plant-wide tasks."""
    return alarm.identity.kind == ANALYSIS_GONE


def reporting_unit(identity: AlarmIdentity) -> str:
    """Return the unit whose process reports an alarm: for lost samples, the alarm's subject."""
    return identity.subject if identity.kind == SAMPLES_LOST else identity.unit
