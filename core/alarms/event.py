"""`AlarmEvent`: one line of an alarm's history."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmState
from core.condition.cells import OperatingPoint
from core.limits import AlarmLevel


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
