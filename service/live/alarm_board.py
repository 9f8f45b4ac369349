"""The alarm list, as everything that shows it sees it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmState
from core.alarms.statistics import ChatterRule
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


class AlarmList(Protocol):
    """All alarms as they are; see :class:`service.measuring.alarms.engine.AlarmEngine`."""

    @property
    def revision(self) -> int:
        """Another number as soon as anything is known otherwise of any alarm."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """What counts as chattering."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, whatever their state."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Look an alarm up. Raises `LookupError` if there is none."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Whether what an alarm watches is known now."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Whether an alarm has come and gone too often until a short while ago."""
        ...

    def count(self) -> AlarmCount:
        """How many alarms are on the list."""
        ...


@dataclass(frozen=True)
class EvidenceStatus:
    """Bundles of evidence since the start.

    Parameters
    ----------
    error
        Why none is written just now; None if nothing hinders.
    """

    error: str | None
    n_waiting: int
    n_written: int
    n_lost: int
