"""What people do to an alarm, and what their shelving does when its time is up."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, Hold, changed
from core.alarms.life_cycle import shown_again, standing_level
from core.units import NS_PER_S

CLOCK_MARGIN_NS = 60 * NS_PER_S
"""By how much a clock may be earlier than when an alarm was shelved: hosts differ by less, and NTP
steps by less."""


class ActionRefusedError(ValueError):
    """An action that does not fit the alarm as it is now; the message says why."""


@dataclass(frozen=True)
class Acknowledge:
    """Somebody has seen an occurrence. One that has come since is not acknowledged by it."""

    actor: str
    occurrence: int
    comment: str = ""


@dataclass(frozen=True)
class Shelve:
    """Somebody takes the alarm off the list for a while."""

    actor: str
    reason: str
    until_ns: int


@dataclass(frozen=True)
class Unshelve:
    """Somebody brings it back before that."""

    actor: str


@dataclass(frozen=True)
class TakeOutOfService:
    """Somebody takes the alarm off the list until further notice, as for maintenance."""

    actor: str
    reason: str


@dataclass(frozen=True)
class ReturnToService:
    """Somebody ends that."""

    actor: str


@dataclass(frozen=True)
class Reset:
    """Somebody releases the latch of an alarm whose condition has gone."""

    actor: str


@dataclass(frozen=True)
class Comment:
    """Somebody says something about the alarm; it stays as it is."""

    actor: str
    text: str


Action: TypeAlias = (
    Acknowledge | Shelve | Unshelve | TakeOutOfService | ReturnToService | Reset | Comment
)


def operate(alarm: Alarm, action: Action, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Do what somebody asks for; what is so already is no event.

    Parameters
    ----------
    now_ns
        The host's time.

    Raises
    ------
    ActionRefusedError
        If it does not fit the alarm as it is now.
    """
    do = _DOERS[type(action)]
    result = do(alarm, action, now_ns)
    if result is None:
        return alarm, ()
    after, change, reason = result
    after, event = changed(alarm, after, change, now_ns, action.actor, reason)
    return after, (event,)


def expire(alarm: Alarm, now_ns: int) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Bring a shelved alarm back when its time is up, by the host's clock.

    It comes back as well where that clock is earlier than when it was shelved: the clock was set
    back, and the end lies as much too far ahead as it was wrong. So it is never hidden from now on
    for longer than it was shelved for, and a minute.
    """
    shelf = alarm.shelf
    reason = None if shelf is None else _why_over(shelf, now_ns)
    if reason is None:
        return alarm, ()
    after = shown_again(replace(alarm, shelf=None))
    after, event = changed(alarm, after, AlarmChange.UNSHELVED, now_ns, reason=reason)
    return after, (event,)


def _why_over(shelf: Hold, now_ns: int) -> str | None:
    """Why a shelf has ended; None if it has not."""
    if shelf.until_ns is not None and shelf.until_ns <= now_ns:
        return "the time it was shelved for is up"
    if now_ns < shelf.since_ns - CLOCK_MARGIN_NS:
        return "the clock was set back since it was shelved"
    return None


_Result: TypeAlias = tuple[Alarm, AlarmChange, str] | None


def _acknowledge(alarm: Alarm, action: Acknowledge, now_ns: int) -> _Result:  # noqa: ARG001
    if action.occurrence != alarm.occurrence:
        raise ActionRefusedError(
            f"occurrence {action.occurrence} was meant, the newest is {alarm.occurrence}:"
            " look at it before acknowledging it"
        )
    if alarm.is_acknowledged:
        return None
    return replace(alarm, is_acknowledged=True), AlarmChange.ACKNOWLEDGED, action.comment


def _shelve(alarm: Alarm, action: Shelve, now_ns: int) -> _Result:
    if action.until_ns <= now_ns:
        raise ActionRefusedError("the time to shelve it for has passed already")
    hold = Hold(action.actor, action.reason, now_ns, action.until_ns)
    return replace(alarm, shelf=hold), AlarmChange.SHELVED, action.reason


def _unshelve(alarm: Alarm, action: Unshelve, now_ns: int) -> _Result:  # noqa: ARG001
    if alarm.shelf is None:
        return None
    return shown_again(replace(alarm, shelf=None)), AlarmChange.UNSHELVED, ""


def _take_out(alarm: Alarm, action: TakeOutOfService, now_ns: int) -> _Result:
    hold = Hold(action.actor, action.reason, now_ns)
    return replace(alarm, outage=hold), AlarmChange.TAKEN_OUT_OF_SERVICE, action.reason


def _return(alarm: Alarm, action: ReturnToService, now_ns: int) -> _Result:  # noqa: ARG001
    if alarm.outage is None:
        return None
    return shown_again(replace(alarm, outage=None)), AlarmChange.RETURNED_TO_SERVICE, ""


def _reset(alarm: Alarm, action: Reset, now_ns: int) -> _Result:  # noqa: ARG001
    if not alarm.is_latched:
        raise ActionRefusedError("nothing to reset: it is not its latch that holds it")
    if not alarm.is_acknowledged:
        raise ActionRefusedError("it must be acknowledged before it is reset")
    after = replace(alarm, level=standing_level(alarm.timers), is_latched=False)
    return after, AlarmChange.RESET, ""


def _comment(alarm: Alarm, action: Comment, now_ns: int) -> _Result:  # noqa: ARG001
    return alarm, AlarmChange.COMMENTED, action.text


_DOERS: dict[type, Callable[..., _Result]] = {
    Acknowledge: _acknowledge,
    Shelve: _shelve,
    Unshelve: _unshelve,
    TakeOutOfService: _take_out,
    ReturnToService: _return,
    Reset: _reset,
    Comment: _comment,
}
