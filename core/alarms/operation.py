"""What people do to an alarm, and what their shelving does when its time is up."""

from dataclasses import dataclass, replace
from typing import TypeAlias

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, Hold, changed
from core.alarms.life_cycle import shown_again, standing_level
from core.units import NS_PER_S

CLOCK_MARGIN_NS = 60 * NS_PER_S
"""By how much a clock may be earlier than when an alarm was shelved: hosts differ by less, and NTP
steps by less."""


class ActionRefusedError(ValueError):
    """An action that does not fit the state of the alarm; the message says why."""


@dataclass(frozen=True)
class Acknowledge:
    """Acknowledge one occurrence; a newer occurrence stays unacknowledged."""

    actor: str
    occurrence: int
    comment: str = ""


@dataclass(frozen=True)
class Shelve:
    """Take an alarm off the list for a while."""

    actor: str
    reason: str
    until_ns: int


@dataclass(frozen=True)
class Unshelve:
    """End the shelving of an alarm before its time."""

    actor: str


@dataclass(frozen=True)
class TakeOutOfService:
    """Take an alarm off the list until further notice, as for maintenance."""

    actor: str
    reason: str


@dataclass(frozen=True)
class ReturnToService:
    """Put an alarm that is out of service back on the list."""

    actor: str


@dataclass(frozen=True)
class Reset:
    """Release the latch of an alarm whose condition has gone."""

    actor: str


@dataclass(frozen=True)
class Comment:
    """Add a comment; the alarm stays as it is."""

    actor: str
    text: str


Action: TypeAlias = (
    Acknowledge | Shelve | Unshelve | TakeOutOfService | ReturnToService | Reset | Comment
)


def operate(alarm: Alarm, action: Action, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Apply an action of a person at a host time; one that changes nothing has no event.

    Raises
    ------
    ActionRefusedError
        If the action does not fit the state of the alarm.
    """
    reason = ""
    match action:
        case Acknowledge(occurrence=occurrence):
            if occurrence != alarm.occurrence:
                raise ActionRefusedError(
                    f"occurrence {occurrence} was meant, the newest is {alarm.occurrence}:"
                    " look at it before acknowledging it"
                )
            if alarm.is_acknowledged:
                return alarm, ()
            after, reason = replace(alarm, is_acknowledged=True), action.comment
            change = AlarmChange.ACKNOWLEDGED
        case Shelve(actor, reason, until_ns):
            if until_ns <= now_ns:
                raise ActionRefusedError("the time to shelve it for has passed already")
            after = replace(alarm, shelf=Hold(actor, reason, now_ns, until_ns))
            change = AlarmChange.SHELVED
        case Unshelve():
            if alarm.shelf is None:
                return alarm, ()
            after, change = shown_again(replace(alarm, shelf=None)), AlarmChange.UNSHELVED
        case TakeOutOfService(actor, reason):
            after = replace(alarm, outage=Hold(actor, reason, now_ns))
            change = AlarmChange.TAKEN_OUT_OF_SERVICE
        case ReturnToService():
            if alarm.outage is None:
                return alarm, ()
            after, change = (
                shown_again(replace(alarm, outage=None)),
                AlarmChange.RETURNED_TO_SERVICE,
            )
        case Reset():
            if not alarm.is_latched:
                raise ActionRefusedError("nothing to reset: it is not its latch that holds it")
            if not alarm.is_acknowledged:
                raise ActionRefusedError("it must be acknowledged before it is reset")
            after = replace(alarm, level=standing_level(alarm.timers), is_latched=False)
            change = AlarmChange.RESET
        case Comment(_, reason):
            after, change = alarm, AlarmChange.COMMENTED
    after, event = changed(alarm, after, change, now_ns, action.actor, reason)
    return after, (event,)


def expire(alarm: Alarm, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """End the shelving of an alarm when its time is up, by the host's clock.

    It ends as well where that clock is earlier than when the alarm was shelved: the clock was set
    back, and the end lies too far ahead by as much. So an alarm is never hidden for longer from now
    on than it was shelved for, and a minute.
    """
    shelf = alarm.shelf
    if shelf is None:
        return alarm, ()
    if shelf.until_ns is not None and shelf.until_ns <= now_ns:
        reason = "the time it was shelved for is up"
    elif now_ns < shelf.since_ns - CLOCK_MARGIN_NS:
        reason = "the clock was set back since it was shelved"
    else:
        return alarm, ()
    after = shown_again(replace(alarm, shelf=None))
    after, event = changed(alarm, after, AlarmChange.UNSHELVED, now_ns, reason=reason)
    return after, (event,)
