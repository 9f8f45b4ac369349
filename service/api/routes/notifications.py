"""Route for the receivers of alarm messages, with the state of their deliveries."""

from typing import Annotated, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from service.api.answers import rendered
from service.api.auth.declared import Reach, subject_router
from service.api.context import Context
from service.api.values import ApiModel, Time
from service.live.receivers import ReceiverView, SenderStatus
from service.settings.notifications import ChannelKind
from service.settings.storage import Origin
from service.store.outbox import Backlog

SenderStateName = Literal[
    "idle", "sending", "retrying", "quiet", "store_fails", "not_in_the_plant_file"
]


class DeadLetterModel(ApiModel):
    """Alarm message that will never be delivered."""

    event_id: Annotated[str, Field(examples=["0b9a6f0e-6a55-4a1e-9a53-0c4b8b3c7b1e"])]
    """Identifier of the message for the receiver."""

    outcome: Literal["refused", "expired"]
    """Reason for giving up: rejected by the receiver ("refused"), or too old ("expired")."""

    reason: Annotated[str, Field(examples=["410 Gone"])]
    """Answer of the receiver to the last attempt, or reason why it was not reached."""

    time: Time
    """Time when the delivery was abandoned."""


class ReceiverModel(ApiModel):
    """Receiver of alarm messages, with waiting, failed and undeliverable messages."""

    n_waiting: int
    """Number of messages waiting for delivery."""

    id: Annotated[str, Field(examples=["control-room"])]
    """Name of the receiver in the plant file; for mail, followed by the recipient."""

    kind: ChannelKind | None
    """Kind of receiver; null if the receiver is no longer in the plant file."""

    address: Annotated[str | None, Field(examples=["https://alarms.example"])]
    """Server of a webhook, or mail address; null if the receiver is no longer in the plant file."""

    state: SenderStateName
    """State of the delivery of messages to the receiver."""

    n_failures: int
    """Number of failed delivery attempts since the last success."""

    failing_since: Time | None
    """Time of the first of these failed attempts; null without failures."""

    reason: Annotated[str | None, Field(examples=["Connection refused"])]
    """Reason for the newest failure; null without failures."""

    next_attempt: Time | None
    """Time of the next attempt after a failure; null if no retry is due."""

    waiting_since: Time | None
    """Time when the oldest waiting message was queued; null without waiting messages."""

    n_dead: int
    """Number of messages that will never be delivered: rejected or too old."""

    last_dead: DeadLetterModel | None
    """Newest message that will never be delivered; null without such a message."""

    last_delivered: Time | None
    """Time of the newest successful delivery; null without a delivery."""


class DeliveryModel(ApiModel):
    """State of all receivers of alarm messages; a replay sends no messages."""

    origin: Origin

    receivers: list[ReceiverModel]
    """Receivers in the order of the plant file, then receivers that are no longer in it."""


NO_BACKLOG = Backlog("", 0, None, 0, None, None)


def delivery_router(context: Context) -> APIRouter:
    """Return the router for the delivery of alarm messages."""
    router = subject_router("", "alarms", reach=Reach.NO_UNIT)

    @router.get("/delivery", response_model=DeliveryModel)
    async def message_receivers() -> Response:
        """List the receivers of alarm messages with their waiting and failed messages."""
        views = await context.receivers()
        return await rendered(
            lambda: DeliveryModel.of(context, receivers=[_receiver(view) for view in views])
        )

    return router


def _receiver(view: ReceiverView) -> ReceiverModel:
    receiver, backlog = view.receiver, view.backlog or NO_BACKLOG
    dead = backlog.last_dead
    status = receiver.status if receiver else SenderStatus()
    return ReceiverModel.of(
        status,
        backlog,
        id=view.name,
        kind=receiver and receiver.kind,
        address=receiver and receiver.address,
        state=status.state if receiver else "not_in_the_plant_file",
        waiting_since=backlog.oldest_ns,
        last_dead=dead
        and DeadLetterModel.of(dead, outcome=dead.state, reason=dead.answer, time=dead.done_ns),
        last_delivered=backlog.delivered_ns,
    )
