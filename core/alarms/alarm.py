"""`Alarm` and `AlarmEvent`: state of an alarm at one time, and one entry of its history."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

from core.condition.cells import OperatingPoint
from core.limits import INACTIVE, NEVER_JUDGED, AlarmLevel, DelayTimer, Judgement


class AlarmState(StrEnum):
    """Life-cycle state of an alarm: states A to I of ISA-18.2, 5.4, without the latched states."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED_UNACKNOWLEDGED = "returned_unacknowledged"
    SHELVED = "shelved"
    SUPPRESSED = "suppressed"
    OUT_OF_SERVICE = "out_of_service"


PLANT = "plant"
"""Unit id of alarms about the service itself. No generating unit may have this id."""


@dataclass(frozen=True)
class AlarmIdentity:
    """Identity of an alarm; stable while the plant file keeps the ids of units and their parts.

    Parameters
    ----------
    unit
        Id of the unit, or `PLANT` for alarms about the service.
    subject
        Id of a channel or bearing, or the fixed subject of the alarm kind, such as "device".
    kind
        Name of an `AlarmKind`.
    """

    unit: str
    subject: str
    kind: str

    @cached_property
    def id(self) -> str:
        """Id string "unit:subject:kind", usable in a URL."""
        return f"{self.unit}:{self.subject}:{self.kind}"


@dataclass(frozen=True)
class Hold:
    """Record that a person shelved an alarm or took it out of service.

    Parameters
    ----------
    actor, reason
        Name of the person, and the reason that the person gave.
    since_ns
        Host time of the action.
    until_ns
        Host time at which shelving expires; None for an alarm out of service.
    """

    actor: str
    reason: str
    since_ns: int
    until_ns: int | None = None


@dataclass(frozen=True)
class AlarmRule:
    """Delays and latching of an alarm.

    Parameters
    ----------
    on_delay_ns
        Time for which the condition must be present without interruption before a level becomes
        active. Time with unknown condition does not count.
    off_delay_ns
        Time for which the condition must be absent before a level ends, counted in the same way.
    is_latching
        Whether the alarm stays active after its condition has ended, until it is reset.
    """

    on_delay_ns: int = 0
    off_delay_ns: int = 0
    is_latching: bool = False


@dataclass(frozen=True)
class Alarm:
    """State of one alarm at one time.

    Parameters
    ----------
    level
        Level after delays and latch; None if the alarm is inactive.
    occurrence
        Number of the newest occurrence: how often the alarm was raised or escalated so far; 0 for
        an alarm that was never raised.
    is_acknowledged
        Whether the newest occurrence is acknowledged.
    raised_ns
        Start of the newest occurrence, ns since 1970 UTC; None before the first.
    raised_at
        Operating point at the start of the newest occurrence; None if unknown.
    n_events
        Number of events of the alarm, equal to the number of the newest event.
    condition
        Newest judgement of the alarm's condition.
    suppressed_by
        Reason why the alarm is suppressed by design; None if it is not suppressed.
    shelf, outage
        Records of the shelving and of the removal from service; None if the alarm is not shelved,
        or is in service.
    is_latched
        Whether the alarm is active only because of its latch.
    timers
        Delay timers of the levels alert and danger, in this order.
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
        """Life-cycle state; for a hidden alarm, out of service before shelved before suppressed."""
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
        """Whether the alarm is inactive and a judgement within limits would not change it."""
        return (
            self.level is None
            and self.condition.is_known
            and self.condition.level is None
            and self.suppressed_by is None
            and self.timers == (INACTIVE, INACTIVE)
        )


class AlarmChange(StrEnum):
    """Kind of event in the history of an alarm."""

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
"""Kinds of events that start a new occurrence of an alarm."""


@dataclass(frozen=True)
class AlarmEvent:
    """Entry in the history of an alarm, such as a transition or a comment.

    Parameters
    ----------
    number
        Sequence number among the events of this alarm, from 1 without gaps.
    level
        Level after the event; if the alarm is then inactive, the level before the event. None if
        the alarm is inactive before and after the event.
    time_ns
        Time of the samples that caused the event, or host time of an action or link event.
    occurrence, raised_at
        Number of the newest occurrence, and operating point at its start; None if unknown.
    value, limit, directions
        Judged value and its limit (None for a judgement without numbers), and directions in which
        the limit was exceeded, at the time of the event.
    actor
        Person who performed the action; empty for automatic events.
    reason
        Reason as a code word or as text, such as the comment of the actor.
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
    directions: str = ""


@dataclass(frozen=True)
class AlarmNews:
    """Alarm after an update or an action, with the events that the update or action caused."""

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
    """Return the changed alarm with its event count increased by one, and the event.

    `before` and `after` are the states of the alarm, `time_ns` is the time of the event. `actor` is
    empty for automatic changes, and `reason` may be empty.
    """
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
        directions=after.condition.directions,
    )
    return after, event
