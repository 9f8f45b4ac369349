"""Routing: outbox letters about an alarm event, for the receivers that request it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmState
from core.limits import AlarmLevel
from service.notifications.message import Composer, dumps
from service.settings.notifications import ReceiverSettings
from service.store.outbox import OutboxMessage

ACTIVE = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED)
HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)

HIDING = (AlarmChange.SHELVED, AlarmChange.SUPPRESSED, AlarmChange.TAKEN_OUT_OF_SERVICE)
SHOWING = (AlarmChange.UNSHELVED, AlarmChange.UNSUPPRESSED, AlarmChange.RETURNED_TO_SERVICE)
ENDING = (AlarmChange.RETURNED, AlarmChange.RESET)

LEVELS = {"alert": AlarmLevel.ALERT, "danger": AlarmLevel.DANGER}


@dataclass(frozen=True)
class Notice:
    """Meaning of an event for a receiver.

    Parameters
    ----------
    change
        Change as the receiver sees it: an alarm that is unshelved while active is raised anew.
    is_active
        Whether the alarm is active after the event.
    ends
        Whether the alarm is over, which concerns only receivers that were notified of its start.
    """

    change: AlarmChange
    is_active: bool
    ends: bool


def notice_of(alarm: Alarm, event: AlarmEvent) -> Notice | None:
    """Return the meaning of an event; None if the alarm is hidden before and after."""
    if event.change in ENDING:  # also of a hidden alarm, whose receivers wait for its end
        return Notice(AlarmChange.RETURNED, is_active=False, ends=True)
    if event.change in SHOWING:
        return _shown(event)
    if event.change in HIDING:
        is_active = event.state_before in ACTIVE
        if event.state_before in HIDDEN:
            is_active = alarm.level is not None
        return Notice(event.change, is_active=is_active, ends=False)
    if event.state_after in HIDDEN:
        return None
    return Notice(event.change, is_active=event.state_after in ACTIVE, ends=False)


class Router:
    """Makes letters of events while these are being stored."""

    def __init__(
        self,
        receivers: Sequence[ReceiverSettings],
        composer: Composer,
        now_ns: Callable[[], int],
    ) -> None:
        self._receivers, self._composer, self._now_ns = receivers, composer, now_ns

    def __call__(self, alarm: Alarm, event: AlarmEvent) -> Iterable[OutboxMessage]:
        """Return one letter for each receiver that requests the event."""
        notice = notice_of(alarm, event)
        if notice is None:
            return []
        found = [
            (name, wanted)
            for receiver in self._receivers
            if (wanted := _wanted(receiver, event, notice)) is not None
            for name in receiver.names
        ]
        if not found:
            return []
        now_ns = self._now_ns()
        message = self._composer.alarm(alarm, event, notice.is_active, now_ns)
        body = dumps(message)
        return [
            OutboxMessage(
                receiver=name,
                event_id=message["id"],
                body=body,
                queued_ns=now_ns,
                is_urgent=_is_urgent(event, wanted),
                is_active=wanted.is_active,
                closes=wanted.ends,
            )
            for name, wanted in found
        ]


def _wanted(receiver: ReceiverSettings, event: AlarmEvent, notice: Notice) -> Notice | None:
    """Return the meaning of an event for one receiver; None if the receiver excludes it."""
    identity = event.identity
    if receiver.units is not None and identity.unit not in receiver.units:
        return None
    if receiver.kinds is not None and identity.kind not in receiver.kinds:
        return None
    if not {event.change, notice.change} & set(receiver.changes):
        return None
    if notice.ends or (event.level or AlarmLevel.ALERT) >= LEVELS[receiver.lowest_priority]:
        return notice
    if event.change is AlarmChange.EASED:  # below the receiver's priority: over for this receiver
        return Notice(AlarmChange.EASED, is_active=False, ends=True)
    return None


def _shown(event: AlarmEvent) -> Notice | None:
    if event.state_after in HIDDEN:  # hidden for another reason
        return None
    if event.state_after in ACTIVE:
        return Notice(AlarmChange.RAISED, is_active=True, ends=False)
    return Notice(AlarmChange.RETURNED, is_active=False, ends=True)


def _is_urgent(event: AlarmEvent, notice: Notice) -> bool:
    begins = notice.change in (AlarmChange.RAISED, AlarmChange.ESCALATED)
    return begins and event.level is AlarmLevel.DANGER
