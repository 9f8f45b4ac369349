"""What the API answers about those who are told of alarms."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, Time

SenderStateName = Literal[
    "idle", "sending", "retrying", "quiet", "store_fails", "not_in_the_plant_file"
]


class DeadLetterModel(ApiModel):
    """A message that will not be delivered."""

    event_id: Annotated[str, Field(examples=["0b9a6f0e-6a55-4a1e-9a53-0c4b8b3c7b1e"])]
    """The identifier that the receiver would have seen."""

    outcome: Literal["refused", "expired"]
    """Whether the receiver has refused it for ever, or it grew too old."""

    reason: Annotated[str, Field(examples=["410 Gone"])]
    """What the receiver has said, or why it was not reached."""

    time: Time
    """When it was given up."""


class ReceiverModel(ApiModel):
    """Somebody who is told of alarms, and what waits for it."""

    id: Annotated[str, Field(examples=["control-room"])]
    """Name in the plant file; of a mail with the recipient."""

    kind: Literal["webhook", "smtp"] | None
    """How it is told; null if it is in the plant file no longer."""

    address: Annotated[str | None, Field(examples=["https://alarms.example"])]
    """Where to: server of a webhook, mailbox of a mail."""

    state: SenderStateName
    """What is being done about it."""

    is_failing: bool
    """Whether the newest attempt was in vain."""

    n_failures: int
    """Attempts in vain since the last one that was not."""

    failing_since: Time | None
    """When the first of them was."""

    reason: Annotated[str | None, Field(examples=["Connection refused"])]
    """Why the newest of them was."""

    next_attempt: Time | None
    """When the next one is due."""

    n_waiting: int
    """Messages that wait for it."""

    waiting_since: Time | None
    """Since when the oldest of them does."""

    n_dead: int
    """Messages that it was never told, because it refused them or they grew too old."""

    last_dead: DeadLetterModel | None
    """The newest of these."""

    last_delivered: Time | None
    """When it took one last."""


class DeliveryModel(ApiModel):
    """All receivers."""

    origin: Literal["live", "replay"]
    """A replay tells nobody."""

    time: Time
    """When this was so."""

    n_waiting: int
    """Messages that wait, over all receivers."""

    n_failing: int
    """Receivers whose newest attempt was in vain."""

    receivers: list[ReceiverModel]
    """In the order of the plant file; then those that are in it no longer."""
