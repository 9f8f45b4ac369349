"""State of the notification receivers and of their messages."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from service.store.outbox import Backlog, Outbox


class SenderState(StrEnum):
    """Activity of a sender; `QUIET` is the wait for the end of the receiver's quiet hours."""

    IDLE = "idle"
    SENDING = "sending"
    RETRYING = "retrying"
    QUIET = "quiet"
    STORE_FAILS = "store_fails"


@dataclass(frozen=True)
class SenderStatus:
    """Status of a sender: its activity and its failed attempts.

    Parameters
    ----------
    n_failures
        Number of failed attempts since the last delivery.
    failing_since_ns
        Start of the present failures, ns since 1970 UTC; None without failures.
    reason
        Reason of the newest failure; None without failures.
    next_attempt_ns
        Time of the next attempt, ns since 1970 UTC; None outside a retry delay.
    """

    state: SenderState = SenderState.IDLE
    n_failures: int = 0
    failing_since_ns: int | None = None
    reason: str | None = None
    next_attempt_ns: int | None = None


@dataclass(frozen=True)
class ReceiverStatus:
    """Receiver in the plant file: name, kind of channel, address, and status of its sender."""

    name: str
    kind: str
    address: str
    status: SenderStatus


@dataclass(frozen=True)
class ReceiverView:
    """State of a receiver and its messages, for the API and the metrics.

    `receiver` is None if it was removed from the plant file, but has messages in the outbox.
    `backlog` counts these messages; None without messages.
    """

    name: str
    receiver: ReceiverStatus | None
    backlog: Backlog | None


def receiver_views(receivers: Iterable[ReceiverStatus], outbox: Outbox) -> list[ReceiverView]:
    """Return the state of all receivers of the plant file, then of removed ones with messages.

    Raises `StoreError` if the outbox cannot be read.
    """
    backlogs = {backlog.receiver: backlog for backlog in outbox.backlogs()}
    views = [ReceiverView(each.name, each, backlogs.pop(each.name, None)) for each in receivers]
    return [*views, *(ReceiverView(name, None, backlog) for name, backlog in backlogs.items())]
