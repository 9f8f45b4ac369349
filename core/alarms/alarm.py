"""`Alarm` and `AlarmEvent`: one alarm at one moment, and one line of its history."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

from core.condition.cells import OperatingPoint
from core.limits import NEVER_JUDGED, RESTED, AlarmLevel, Condition, DelayTimer


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
"""In the place of a unit: what concerns all of them. No unit may be called so."""


@dataclass(frozen=True)
class AlarmIdentity:
    """Which alarm: the same for as long as the plant calls its parts by the same names.

    Parameters
    ----------
    unit
        `PLANT` where it is about the service itself.
    subject
        Channel or bearing that it is about; "device" or "link" where it is about the whole unit,
        "store", "service" or "captures" where it is about the service.
    """

    unit: str
    subject: str
    kind: str

    @cached_property
    def id(self) -> str:
        """All of it in one word, fit for a URL."""
        return f"{self.unit}:{self.subject}:{self.kind}"


@dataclass(frozen=True)
class Hold:
    """That somebody has taken an alarm off the list, and why.

    Parameters
    ----------
    until_ns
        When that ends by itself, host time; None if never.
    """

    actor: str
    reason: str
    since_ns: int
    until_ns: int | None = None


@dataclass(frozen=True)
class AlarmRule:
    """How long a condition must last, and whether what it raised stays.

    Parameters
    ----------
    on_delay_ns, off_delay_ns
        Known time without interruption before a level counts, or counts no longer.
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
        Of the alarm itself, after delays and latch; None if it is not active.
    occurrence
        How often it was raised or rose in level; the number that is acknowledged.
    is_acknowledged
        Whether somebody has seen this occurrence.
    raised_ns
        When this occurrence began.
    raised_at
        Under which operating condition; None where that was not known.
    n_events
        How many events it has had; the newest has this number.
    condition
        What was found last.
    suppressed_by
        Why it counts for nothing by design; None if it counts.
    shelf, outage
        Whether somebody has shelved it, or taken it out of service.
    is_latched
        Whether only its latch keeps it at its level.
    timers
        Of alert and danger.
    """

    identity: AlarmIdentity
    level: AlarmLevel | None = None
    occurrence: int = 0
    is_acknowledged: bool = True
    raised_ns: int | None = None
    raised_at: OperatingPoint | None = None
    n_events: int = 0
    condition: Condition = NEVER_JUDGED
    suppressed_by: str | None = None
    shelf: Hold | None = None
    outage: Hold | None = None
    is_latched: bool = False
    timers: tuple[DelayTimer, DelayTimer] = (RESTED, RESTED)

    @property
    def state(self) -> AlarmState:
        """State of the life cycle; what hides an alarm most thoroughly names it."""
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
            and self.timers == (RESTED, RESTED)
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
    """A transition of an alarm, or news of it that somebody must be able to find later.

    Parameters
    ----------
    number
        Of this alarm's events, from 1 without a hole.
    level
        That the alarm has after it; of one that has returned or was reset, that it had.
    time_ns
        Of the samples where they decided, of the host where a person or a link did.
    occurrence
        Which occurrence of the alarm it belongs to.
    actor
        Who did it; empty if nobody did.
    reason
        Why, in a word or in the words of the actor.
    raised_at
        Under which operating condition that occurrence was raised; None where that was not known.
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
    """An alarm with the events that have led to what it is now.

    Parameters
    ----------
    peer
        Address from which somebody asked for them; None if nobody did, or it is not known.
    command
        Which command asked for them, where it came through the database: it is answered by being
        stored with them.
    """

    alarm: Alarm
    events: Sequence[AlarmEvent]
    peer: str | None = None
    command: str | None = None


def changed(
    before: Alarm,
    after: Alarm,
    change: AlarmChange,
    time_ns: int,
    actor: str = "",
    reason: str = "",
) -> tuple[Alarm, AlarmEvent]:
    """Count one more event and write it down.

    Parameters
    ----------
    after
        The alarm as it is to be, but for the number of its events.
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
    )
    return after, event
