"""Receivers of alarm messages, and the messages that wait for them."""

from typing import Annotated, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from service.api.answers import rendered_now
from service.api.auth.declared import Reach, needs
from service.api.context import Context
from service.api.problems import problem_responses
from service.api.values import ApiModel, Time
from service.notifications.sender import ReceiverView, SenderStatus
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.outbox import Backlog, MessageState, StoredMessage

SenderStateName = Literal[
    "idle", "sending", "retrying", "quiet", "store_fails", "not_in_the_plant_file"
]


class DeadLetterModel(ApiModel):
    """A message that will not be delivered."""

    event_id: Annotated[str, Field(examples=["0b9a6f0e-6a55-4a1e-9a53-0c4b8b3c7b1e"])]
    """Identifier of the message for the receiver."""

    outcome: Literal["refused", "expired"]
    """Permanently rejected by the receiver, or too old."""

    reason: Annotated[str, Field(examples=["410 Gone"])]
    """Answer of the receiver, or why it was not reached."""

    time: Time
    """Time when delivery ended."""


class ReceiverModel(ApiModel):
    """A receiver of alarm messages, and its backlog."""

    id: Annotated[str, Field(examples=["control-room"])]
    """Name in the plant file; for mail, with the recipient."""

    kind: Literal["webhook", "smtp"] | None
    """Channel; null if the receiver is no longer in the plant file."""

    address: Annotated[str | None, Field(examples=["https://alarms.example"])]
    """Server of a webhook, or mail address."""

    state: SenderStateName
    """State of the sender."""

    is_failing: bool
    """Whether the newest attempt failed."""

    n_failures: int
    """Failed attempts since the last success."""

    failing_since: Time | None
    """Time of the first of them."""

    reason: Annotated[str | None, Field(examples=["Connection refused"])]
    """Reason of the newest of them."""

    next_attempt: Time | None
    """Time of the next attempt."""

    n_waiting: int
    """Waiting messages."""

    waiting_since: Time | None
    """Start of the wait of the oldest message."""

    n_dead: int
    """Messages never delivered: rejected or too old."""

    last_dead: DeadLetterModel | None
    """Newest of these."""

    last_delivered: Time | None
    """Time of the last delivery."""


class DeliveryModel(ApiModel):
    """All receivers."""

    origin: Literal["live", "replay"]
    """A replay sends no messages."""

    time: Time
    """Present time."""

    n_waiting: int
    """Waiting messages of all receivers."""

    n_failing: int
    """Receivers whose newest attempt failed."""

    receivers: list[ReceiverModel]
    """Receivers in the order of the plant file, then those no longer in it."""


NO_BACKLOG = Backlog("", 0, None, 0, None, None)


def delivery_router(context: Context) -> APIRouter:
    """Return the route of deliveries."""
    router = APIRouter(
        prefix="/api/v1", tags=["alarms"], dependencies=[needs(Permission.READ, Reach.NO_UNIT)]
    )

    @router.get(
        "/delivery",
        summary="Receivers of alarm messages",
        response_model=DeliveryModel,
        responses=problem_responses(503),
    )
    async def delivery() -> Response:
        """List all receivers of webhooks and mail: backlog, failures, undelivered messages."""
        receivers = [_receiver(view) for view in await context.deliveries.look()]
        return await rendered_now(lambda: _delivery(context, receivers))

    return router


def _delivery(context: Context, receivers: list[ReceiverModel]) -> DeliveryModel:
    return DeliveryModel(
        origin=context.origin.value,
        time=rfc3339(context.clock.now_ns()),
        n_waiting=sum(receiver.n_waiting for receiver in receivers),
        n_failing=sum(receiver.is_failing for receiver in receivers),
        receivers=receivers,
    )


def _receiver(view: ReceiverView) -> ReceiverModel:
    receiver, backlog = view.receiver, view.backlog or NO_BACKLOG
    status = view.status or SenderStatus()
    return ReceiverModel(
        id=view.name,
        kind=receiver.kind if receiver else None,
        address=receiver.address if receiver else None,
        state=status.state.value if view.status else "not_in_the_plant_file",
        is_failing=status.n_failures > 0,
        n_failures=status.n_failures,
        failing_since=_time(status.failing_since_ns),
        reason=status.reason,
        next_attempt=_time(status.next_attempt_ns),
        n_waiting=backlog.n_waiting,
        waiting_since=_time(backlog.oldest_ns),
        n_dead=backlog.n_dead,
        last_dead=_dead(backlog.last_dead),
        last_delivered=_time(backlog.delivered_ns),
    )


def _dead(letter: StoredMessage | None) -> DeadLetterModel | None:
    if letter is None or letter.done_ns is None:
        return None
    return DeadLetterModel(
        event_id=letter.event_id,
        outcome="refused" if letter.state is MessageState.REFUSED else "expired",
        reason=letter.answer,
        time=rfc3339(letter.done_ns),
    )


def _time(time_ns: int | None) -> str | None:
    return None if time_ns is None else rfc3339(time_ns)
