"""`AlarmCount`: how many alarms are on the list."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from core.alarms.alarm import Alarm, AlarmState
from core.limits import AlarmLevel

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class AlarmCount:
    """How many alarms are on the list.

    Parameters
    ----------
    n_active
        Active and not hidden.
    n_danger
        Of these, at the level of danger.
    n_unacknowledged
        Active or returned, not hidden, and nobody has seen their newest occurrence.
    n_hidden
        Shelved, suppressed or out of service.
    n_unjudged
        Not active, not hidden, and what they watch cannot be judged now.
    """

    n_active: int
    n_danger: int
    n_unacknowledged: int
    n_hidden: int
    n_unjudged: int


def count_of(alarms: Sequence[Alarm], is_judged: Callable[[Alarm], bool]) -> AlarmCount:
    """Count alarms, whatever their state."""
    shown = [alarm for alarm in alarms if alarm.state not in HIDDEN]
    return AlarmCount(
        n_active=sum(alarm.level is not None for alarm in shown),
        n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in shown),
        n_unacknowledged=sum(not alarm.is_acknowledged for alarm in shown),
        n_hidden=len(alarms) - len(shown),
        n_unjudged=sum(a.level is None and not is_judged(a) for a in shown),
    )
