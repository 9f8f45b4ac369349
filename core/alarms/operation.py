"""Actions of people on an alarm, and the expiry of shelving."""

from dataclasses import dataclass, replace
from typing import TypeAlias

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, Hold, changed
from core.alarms.life_cycle import shown_again, standing_level
from core.units import NS_PER_S

CLOCK_MARGIN_NS = 60 * NS_PER_S
"""Time by which the host clock may be earlier than the time of shelving before the clock counts as
set back. Clock differences between hosts and steps by NTP are smaller."""


class ActionRefusedError(ValueError):
    """Error raised if an action does not fit the state of the alarm; the message says why."""


@dataclass(frozen=True)
class Acknowledge:
    """Acknowledgement of the newest occurrence of an alarm; other occurrences are refused.

    It has no effect if the occurrence is already acknowledged.
    """

    actor: str
    occurrence: int
    comment: str = ""


@dataclass(frozen=True)
class Shelve:
    """Shelving of an alarm: hidden until host time `until_ns`, which must be in the future."""

    actor: str
    reason: str
    until_ns: int


@dataclass(frozen=True)
class Unshelve:
    """Early end of the shelving of an alarm; no effect on an alarm that is not shelved."""

    actor: str


@dataclass(frozen=True)
class TakeOutOfService:
    """Removal of an alarm from service without an end time, for example for maintenance."""

    actor: str
    reason: str


@dataclass(frozen=True)
class ReturnToService:
    """Return of an alarm to service; no effect on an alarm that is in service."""

    actor: str


@dataclass(frozen=True)
class Reset:
    """Release of the latch of an alarm; refused unless the alarm is latched and acknowledged."""

    actor: str


@dataclass(frozen=True)
class Comment:
    """Comment on an alarm, added to its history without a change of its state."""

    actor: str
    text: str


Action: TypeAlias = (
    Acknowledge | Shelve | Unshelve | TakeOutOfService | ReturnToService | Reset | Comment
)


def operate(alarm: Alarm, action: Action, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Return the alarm after an action at host time `now_ns`, and its event if it had an effect.

    Raises ActionRefusedError if the action does not fit the state of the alarm.
    """
    reason = ""
    match action:
        case Acknowledge(occurrence=occurrence):
            if occurrence != alarm.occurrence:
                raise ActionRefusedError(
                    f"occurrence {occurrence} is not the newest; check occurrence"
                    f" {alarm.occurrence} before acknowledging it"
                )
            if alarm.is_acknowledged:
                return alarm, ()
            after, reason = replace(alarm, is_acknowledged=True), action.comment
            change = AlarmChange.ACKNOWLEDGED
        case Shelve(actor, reason, until_ns):
            if until_ns <= now_ns:
                raise ActionRefusedError("the end of shelving must be later than the present time")
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
            after = shown_again(replace(alarm, outage=None))
            change = AlarmChange.RETURNED_TO_SERVICE
        case Reset():
            if not alarm.is_latched:
                raise ActionRefusedError("the alarm is not latched, so there is nothing to reset")
            if not alarm.is_acknowledged:
                raise ActionRefusedError("the alarm must be acknowledged before it is reset")
            after = replace(alarm, level=standing_level(alarm.timers), is_latched=False)
            change = AlarmChange.RESET
        case Comment(_, reason):
            after, change = alarm, AlarmChange.COMMENTED
    after, event = changed(alarm, after, change, now_ns, action.actor, reason)
    return after, (event,)


def expire(alarm: Alarm, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Unshelve an alarm if its shelving has expired at a host time; return it and the events.

    Shelving also ends if the host clock is more than `CLOCK_MARGIN_NS` earlier than the time of
    shelving: the clock was set back, so the expiry time is too late by the same amount. An alarm is
    therefore hidden for at most the shelving time plus one minute.
    """
    shelf = alarm.shelf
    if shelf is None:
        return alarm, ()
    if shelf.until_ns is not None and shelf.until_ns <= now_ns:
        reason = "the shelving time has ended"
    elif now_ns < shelf.since_ns - CLOCK_MARGIN_NS:
        reason = "the clock was set back after the alarm was shelved"
    else:
        return alarm, ()
    after = shown_again(replace(alarm, shelf=None))
    after, event = changed(alarm, after, AlarmChange.UNSHELVED, now_ns, reason=reason)
    return after, (event,)
