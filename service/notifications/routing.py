"""Routing of alarm events: outbox messages for the receivers that subscribe to an event."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmState
from core.alarms.statistics import HIDDEN
from core.limits import AlarmLevel
from service.notifications.message import Composer, dumps
from service.settings.notifications import ReceiverSettings
from service.store.outbox import OutboxMessage

ACTIVE = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED)

HIDING = (AlarmChange.SHELVED, AlarmChange.SUPPRESSED, AlarmChange.TAKEN_OUT_OF_SERVICE)
SHOWING = (AlarmChange.UNSHELVED, AlarmChange.UNSUPPRESSED, AlarmChange.RETURNED_TO_SERVICE)
BEGINNING = (AlarmChange.RAISED, AlarmChange.ESCALATED)
ENDING = (AlarmChange.RETURNED, AlarmChange.RESET)

LEVELS = {"alert": AlarmLevel.ALERT, "danger": AlarmLevel.DANGER}


@dataclass(frozen=True)
class Notice:
    """Alarm event in the view of receivers, which do not see hidden alarms.

    Parameters
    ----------
    change
        Change in the view of the receiver: unshelving an active alarm is `RAISED`.
    is_active
        Whether the alarm is active after the event.
    ends
        Whether the alarm is over for the receiver; only receivers of previous notices of the alarm
        need this notice.
    """

    change: AlarmChange
    is_active: bool
    ends: bool


def _notice_of(alarm: Alarm, event: AlarmEvent) -> Notice | None:
    """Return the notice of an event; None if the alarm is hidden before and after the event."""
    if event.change in ENDING:  # also for a hidden alarm: receivers must be notified of its end
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
    """Callable that creates the outbox messages of an alarm event when the event is stored."""

    def __init__(
        self,
        receivers: Sequence[ReceiverSettings],
        composer: Composer,
        now_ns: Callable[[], int],
    ) -> None:
        self._receivers, self._composer, self._now_ns = receivers, composer, now_ns

    def __call__(self, alarm: Alarm, event: AlarmEvent) -> Iterable[OutboxMessage]:
        """Return one outbox message for each receiver that subscribes to the event."""
        notice = _notice_of(alarm, event)
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
        is_danger = event.level is AlarmLevel.DANGER
        return [
            OutboxMessage(
                receiver=name,
                event_id=message["id"],
                body=body,
                queued_ns=now_ns,
                is_urgent=is_danger and wanted.change in BEGINNING,
                is_active=wanted.is_active,
                closes=wanted.ends,
            )
            for name, wanted in found
        ]


def _wanted(receiver: ReceiverSettings, event: AlarmEvent, notice: Notice) -> Notice | None:
    """Return the notice for one receiver; None if the receiver settings exclude the event."""
    identity = event.identity
    if receiver.units is not None and identity.unit not in receiver.units:
        return None
    if receiver.kinds is not None and identity.kind not in receiver.kinds:
        return None
    if not {event.change, notice.change} & set(receiver.changes):
        return None
    if notice.ends or (event.level or AlarmLevel.ALERT) >= LEVELS[receiver.lowest_priority]:
        return notice
    if (
        event.change is AlarmChange.EASED
    ):  # below the priority of the receiver, for which the alarm is over
        return Notice(AlarmChange.EASED, is_active=False, ends=True)
    return None


def _shown(event: AlarmEvent) -> Notice | None:
    if event.state_after in HIDDEN:  # still hidden for another reason
        return None
    if event.state_after in ACTIVE:
        return Notice(AlarmChange.RAISED, is_active=True, ends=False)
    return Notice(AlarmChange.RETURNED, is_active=False, ends=True)
