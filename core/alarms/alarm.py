"""`Alarm` and `AlarmEvent`: one alarm at one moment, and one line of its history."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

from core.condition.cells import OperatingPoint
from core.limits import INACTIVE, NEVER_JUDGED, AlarmLevel, DelayTimer, Judgement


class AlarmState(StrEnum):
    """Where an alarm stands in its life cycle (ISA-18.2, 5.4: states A to H, latches apart)."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED_UNACKNOWLEDGED = "returned_unacknowledged"
    SHELVED = "shelved"
    SUPPRESSED = "suppressed"
    OUT_OF_SERVICE = "out_of_service"


PLANT = "plant"
"""Unit of alarms about the service. No unit may have this name."""


@dataclass(frozen=True)
class AlarmIdentity:
    """Identity of an alarm, the same as long as the plant file names its parts alike.

    Parameters
    ----------
    unit
        Unit, or `PLANT` for alarms about the service.
    subject
        Id of a channel or bearing, or the subject of its kind, such as "device".
    kind
        Name of an `AlarmKind`.
    """

    unit: str
    subject: str
    kind: str

    @cached_property
    def id(self) -> str:
        """Id in one word, fit for a URL."""
        return f"{self.unit}:{self.subject}:{self.kind}"


@dataclass(frozen=True)
class Hold:
    """Who has taken an alarm off the list, and why.

    Parameters
    ----------
    until_ns
        When it ends by itself, host time; None if never.
    """

    actor: str
    reason: str
    since_ns: int
    until_ns: int | None = None


@dataclass(frozen=True)
class AlarmRule:
    """Delays and latch of an alarm.

    Parameters
    ----------
    on_delay_ns, off_delay_ns
        Known time without contradiction before a level counts, or ceases to.
    is_latching
        Whether the alarm stays active after its condition has gone, until it is reset.
    """

    on_delay_ns: int = 0
    off_delay_ns: int = 0
    is_latching: bool = False


@dataclass(frozen=True)
class Alarm:
    """One alarm at one moment.

    Parameters
    ----------
    level
        Level after delays and latch; None if the alarm is not active.
    occurrence
        Number of times that it was raised or rose in level; acknowledged by this number.
    is_acknowledged
        Whether this occurrence is acknowledged.
    raised_ns
        Start of this occurrence.
    raised_at
        Operating condition at that time, if known.
    n_events
        Number of its events, and of the newest event.
    condition
        Newest judgement.
    suppressed_by
        Why it is suppressed by design; None if it is not.
    shelf, outage
        Who has shelved it or taken it out of service, if anyone.
    is_latched
        Whether only its latch holds its level.
    timers
        Delays of alert and danger.
    """

    identity: AlarmIdentity
    level: AlarmLevel | None = None
    occurrence: int = 0
    is_acknowledged: bool = True
    raised_ns: int | None = None
    raised_at: OperatingPoint | None = None
    n_events: int = 0
    condition: Judgement = NEVER_JUDGED
    suppressed_by: str | None = None
    shelf: Hold | None = None
    outage: Hold | None = None
    is_latched: bool = False
    timers: tuple[DelayTimer, DelayTimer] = (INACTIVE, INACTIVE)

    @property
    def state(self) -> AlarmState:
        """State of the life cycle: out of service, shelved or suppressed come before all others."""
        if self.outage is not None:
            return AlarmState.OUT_OF_SERVICE
        if self.shelf is not None:
            return AlarmState.SHELVED
        if self.suppressed_by is not None:
            return AlarmState.SUPPRESSED
        if self.level is None:
            returned = AlarmState.RETURNED_UNACKNOWLEDGED
            return AlarmState.NORMAL if self.is_acknowledged else returned
        return AlarmState.ACKNOWLEDGED if self.is_acknowledged else AlarmState.UNACKNOWLEDGED

    @cached_property
    def is_settled_inactive(self) -> bool:
        """Whether one more condition that is known and within limits leaves it unchanged."""
        return (
            self.level is None
            and self.condition.is_known
            and self.condition.level is None
            and self.suppressed_by is None
            and self.timers == (INACTIVE, INACTIVE)
        )


class AlarmChange(StrEnum):
    """What happened to an alarm."""

    RAISED = "raised"
    ESCALATED = "escalated"
    EASED = "eased"
    RETURNED = "returned"
    LATCHED = "latched"
    RESET = "reset"
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    SUPPRESSED = "suppressed"
    UNSUPPRESSED = "unsuppressed"
    TAKEN_OUT_OF_SERVICE = "taken_out_of_service"
    RETURNED_TO_SERVICE = "returned_to_service"
    COMMENTED = "commented"
    CONDITION_UNKNOWN = "condition_unknown"
    CONDITION_KNOWN = "condition_known"


ANNOUNCED = (AlarmChange.RAISED, AlarmChange.ESCALATED)
"""The changes that begin a new occurrence."""


@dataclass(frozen=True)
class AlarmEvent:
    """A transition of an alarm, or another entry of its history.

    Parameters
    ----------
    number
        Number among this alarm's events, from 1 without gaps.
    level
        Level after the event, or before it if the alarm has returned or was reset.
    time_ns
        Time of the samples that decided; host time of an action or of the link.
    actor
        Person who acted; empty if none did.
    reason
        Why, in a word or in the words of the actor.
    """

    identity: AlarmIdentity
    number: int
    change: AlarmChange
    level: AlarmLevel | None
    state_before: AlarmState
    state_after: AlarmState
    time_ns: int
    occurrence: int
    value: float | None = None
    limit: float | None = None
    actor: str = ""
    reason: str = ""
    raised_at: OperatingPoint | None = None


@dataclass(frozen=True)
class AlarmNews:
    """An alarm with its newest events."""

    alarm: Alarm
    events: Sequence[AlarmEvent]


def changed(
    before: Alarm,
    after: Alarm,
    change: AlarmChange,
    time_ns: int,
    actor: str = "",
    reason: str = "",
) -> tuple[Alarm, AlarmEvent]:
    """The alarm after a change, with the number of its events counted up, and the event."""
    after = replace(after, n_events=before.n_events + 1)
    event = AlarmEvent(
        identity=after.identity,
        number=after.n_events,
        change=change,
        level=after.level if after.level is not None else before.level,
        state_before=before.state,
        state_after=after.state,
        time_ns=time_ns,
        occurrence=after.occurrence,
        value=after.condition.value,
        limit=after.condition.limit,
        actor=actor,
        reason=reason,
        raised_at=after.raised_at,
    )
    return after, event
