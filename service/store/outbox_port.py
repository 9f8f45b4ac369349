"""The outbox as the rest of the service sees it: what is told to whom, and what came of it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmEvent


class LetterState(StrEnum):
    """What has become of a letter; all but the first are for ever."""

    WAITING = "waiting"
    DELIVERED = "delivered"
    REFUSED = "refused"
    EXPIRED = "expired"


DEAD = (LetterState.REFUSED, LetterState.EXPIRED)
"""Letters that will never be delivered."""


@dataclass(frozen=True)
class Letter:
    """An event of an alarm, to be told to one receiver.

    Parameters
    ----------
    event_id
        The same for all receivers and all attempts.
    body
        The message as JSON.
    queued_ns
        When it was written, by the host's clock.
    is_urgent
        Whether it ends quiet hours.
    is_active
        Whether the receiver takes the alarm for active once it has been told.
    closes
        Whether it is only for a receiver that takes the alarm for active.
    """

    receiver: str
    event_id: str
    body: str
    queued_ns: int
    is_urgent: bool
    is_active: bool
    closes: bool


Address = Callable[[Alarm, AlarmEvent], Iterable[Letter]]
"""Who is to be told of an event of an alarm."""


def nobody(alarm: Alarm, event: AlarmEvent) -> Iterable[Letter]:  # noqa: ARG001
    """Tell nobody."""
    return ()


@dataclass(frozen=True)
class StoredLetter:
    """A letter in the outbox.

    Parameters
    ----------
    id
        Higher than that of all letters that were queued before it.
    n_attempts
        How often it was tried in vain.
    answer
        What came of the newest attempt, in words.
    done_ns
        When it was delivered or given up; None while it waits.
    """

    id: int
    receiver: str
    event_id: str
    body: str
    queued_ns: int
    is_urgent: bool
    state: LetterState
    n_attempts: int
    answer: str
    done_ns: int | None


@dataclass(frozen=True)
class Backlog:
    """What an outbox holds for one receiver.

    Parameters
    ----------
    oldest_ns
        Since when the first of those that wait does; None if none does.
    n_dead
        How many were refused or given up, ever.
    last_dead
        The newest of these.
    delivered_ns
        When one was delivered last.
    """

    receiver: str
    n_waiting: int
    oldest_ns: int | None
    n_dead: int
    last_dead: StoredLetter | None
    delivered_ns: int | None


class Outbox(Protocol):
    """Durable letters; each method that changes something is on the disk when it returns."""

    def waiting(self, receiver: str, limit: int) -> Sequence[StoredLetter]:
        """Read the first of what waits for a receiver, in order."""
        ...

    def urgent(self, receiver: str) -> bool:
        """Whether anything that waits for a receiver ends quiet hours."""
        ...

    def finish(self, letter: int, state: LetterState, answer: str, now_ns: int) -> None:
        """Note that a letter was delivered or refused."""
        ...

    def fail(self, letter: int, answer: str) -> None:
        """Note an attempt in vain; the letter goes on waiting."""
        ...

    def expire(self, receiver: str, before_ns: int, answer: str, now_ns: int) -> int:
        """Give up what has waited since before a time, and happened before it; return how many."""
        ...

    def revive(self, receiver: str, now_ns: int) -> int:
        """Let what was refused or given up wait again, in its old place; return how many."""
        ...

    def backlogs(self) -> Sequence[Backlog]:
        """Look at everyone for whom there ever was a letter."""
        ...
