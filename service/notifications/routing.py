"""From an event of an alarm to letters for the receivers that want it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time
from zoneinfo import ZoneInfo

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmState
from core.limits import AlarmLevel
from core.units import NS_PER_S
from service.notifications.message import Composer, dumps
from service.store.outbox import OutboxMessage

ACTIVE = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED)
HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)

HIDING = (AlarmChange.SHELVED, AlarmChange.SUPPRESSED, AlarmChange.TAKEN_OUT_OF_SERVICE)
SHOWING = (AlarmChange.UNSHELVED, AlarmChange.UNSUPPRESSED, AlarmChange.RETURNED_TO_SERVICE)
ENDING = (AlarmChange.RETURNED, AlarmChange.RESET)


@dataclass(frozen=True)
class Route:
    """What a receiver wants to be told; None where it wants everything.

    Parameters
    ----------
    receiver
        Name of its letters.
    """

    receiver: str
    changes: frozenset[AlarmChange]
    units: frozenset[str] | None = None
    kinds: frozenset[str] | None = None
    lowest: AlarmLevel = AlarmLevel.ALERT

    def covers(self, event: AlarmEvent) -> bool:
        """Whether it wants to know of this alarm at all."""
        identity = event.identity
        return (self.units is None or identity.unit in self.units) and (
            self.kinds is None or identity.kind in self.kinds
        )


@dataclass(frozen=True)
class Telling:
    """What an event amounts to for those who are told.

    Parameters
    ----------
    as_
        The change that it is to them: what comes back from the shelf active is raised anew.
    is_active
        Whether the alarm is active after it.
    ends
        Whether it is over, so that only those care who were told that it had begun.
    """

    as_: AlarmChange
    is_active: bool
    ends: bool


def telling(alarm: Alarm, event: AlarmEvent) -> Telling | None:
    """Say what an event amounts to; None if what hides the alarm hides it, too."""
    if event.change in ENDING:  # also of a hidden alarm: who was told of it waits for its end
        return Telling(AlarmChange.RETURNED, is_active=False, ends=True)
    if event.change in SHOWING:
        return _shown(event)
    if event.change in HIDING:
        is_active = event.state_before in ACTIVE
        if event.state_before in HIDDEN:
            is_active = alarm.level is not None
        return Telling(event.change, is_active=is_active, ends=False)
    if event.state_after in HIDDEN:
        return None
    return Telling(event.change, is_active=event.state_after in ACTIVE, ends=False)


class Router:
    """Writes letters; called while events are being stored.

    Parameters
    ----------
    now_ns
        The host's clock.
    """

    def __init__(
        self, routes: Sequence[Route], composer: Composer, now_ns: Callable[[], int]
    ) -> None:
        self._routes, self._composer, self._now_ns = routes, composer, now_ns

    def __call__(self, alarm: Alarm, event: AlarmEvent) -> Iterable[OutboxMessage]:
        """Letters that tell of an event, one for each receiver that wants to know."""
        told = telling(alarm, event)
        found = [(r, one) for r in self._routes if told and (one := _for(r, event, told))]
        if told is None or not found:
            return []
        now_ns = self._now_ns()
        message = self._composer.alarm(alarm, event, told.is_active, now_ns)
        body = dumps(message)
        return [
            OutboxMessage(
                receiver=route.receiver,
                event_id=message["id"],
                body=body,
                queued_ns=now_ns,
                is_urgent=_is_urgent(event, one),
                is_active=one.is_active,
                closes=one.ends,
            )
            for route, one in found
        ]


def _for(route: Route, event: AlarmEvent, told: Telling) -> Telling | None:
    """What it amounts to for one receiver; None if it does not want to know."""
    if not route.covers(event) or not route.changes & {event.change, told.as_}:
        return None
    if told.ends or (event.level or AlarmLevel.ALERT) >= route.lowest:
        return told
    if event.change is AlarmChange.EASED:  # below what it wants to know: to it, it is over
        return Telling(AlarmChange.EASED, is_active=False, ends=True)
    return None


def _shown(event: AlarmEvent) -> Telling | None:
    if event.state_after in HIDDEN:  # something else still hides it
        return None
    if event.state_after in ACTIVE:
        return Telling(AlarmChange.RAISED, is_active=True, ends=False)
    return Telling(AlarmChange.RETURNED, is_active=False, ends=True)


def _is_urgent(event: AlarmEvent, told: Telling) -> bool:
    begins = told.as_ in (AlarmChange.RAISED, AlarmChange.ESCALATED)
    return begins and event.level is AlarmLevel.DANGER


@dataclass(frozen=True)
class QuietHours:
    """From start to end every day, over midnight if the end is before the start."""

    start: time
    end: time
    zone: ZoneInfo

    def hold_at(self, now_ns: int) -> bool:
        """Whether a moment lies within them."""
        moment = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).astimezone(self.zone).time()
        if self.start < self.end:
            return self.start <= moment < self.end
        return moment >= self.start or moment < self.end
