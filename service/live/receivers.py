"""State of the notification receivers and of their messages."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from service.runtime.models import SERVED, TimeNs
from service.settings.notifications import ChannelKind
from service.store.outbox import DeadLetter, Outbox


class SenderState(StrEnum):
    """Activity of a sender; `QUIET` is the wait for the end of the receiver's quiet hours.

    `REMOVED` is the state of a receiver without a sender.
    """

    IDLE = "idle"
    SENDING = "sending"
    RETRYING = "retrying"
    QUIET = "quiet"
    STORE_FAILS = "store_fails"
    REMOVED = "not_in_the_plant_file"


@dataclass(frozen=True)
class ReceiverView:
    """Receiver of alarm messages, with waiting, failed and undeliverable messages."""

    __pydantic_config__ = SERVED

    id: Annotated[str, Field(examples=["control-room"])]
    """Name of the receiver in the plant file; for mail, followed by the recipient."""

    kind: ChannelKind | None = None
    """Kind of receiver; null if the receiver is no longer in the plant file."""

    address: Annotated[str | None, Field(examples=["https://alarms.example"])] = None
    """Server of a webhook, or mail address; null if the receiver is no longer in the plant file."""

    state: SenderState = SenderState.IDLE
    """State of the delivery of messages to the receiver."""

    n_failures: int = 0
    """Number of failed delivery attempts since the last success."""

    failing_since_ns: TimeNs | None = None
    """Time of the first of these failed attempts; null without failures."""

    reason: Annotated[str | None, Field(examples=["Connection refused"])] = None
    """Reason for the newest failure; null without failures."""

    next_attempt_ns: TimeNs | None = None
    """Time of the next attempt after a failure; null if no retry is due."""

    n_waiting: int = 0
    """Number of messages waiting for delivery."""

    waiting_since_ns: TimeNs | None = None
    """Time when the oldest waiting message was queued; null without waiting messages."""

    n_dead: int = 0
    """Number of messages that will never be delivered: rejected or too old."""

    last_dead: DeadLetter | None = None
    """Newest message that will never be delivered; null without such a message."""

    last_delivered_ns: TimeNs | None = None
    """Time of the newest successful delivery; null without a delivery."""


def with_backlogs(receivers: Iterable[ReceiverView], outbox: Outbox) -> list[ReceiverView]:
    """Return receivers of the plant file with their messages, then removed ones with messages.

    Raises `StoreError` if the outbox cannot be read.
    """
    backlogs = {name: vars(backlog) for name, backlog in outbox.backlogs().items()}
    views = [replace(each, **backlogs.pop(each.id, {})) for each in receivers]
    removed = [ReceiverView(id=name, state=SenderState.REMOVED) for name in backlogs]
    return views + [replace(each, **backlogs[each.id]) for each in removed]
