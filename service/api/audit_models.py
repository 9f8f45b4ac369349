"""What the API says of the audit trail."""

from typing import Annotated, Any, Literal

from pydantic import Field

from service.api.models import ApiModel, Time

SourceName = Literal["api", "command_line", "padwatch"]


class AuditEntryModel(ApiModel):
    """One entry of the audit trail."""

    number: Annotated[int, Field(examples=[117])]
    """From 1 without a hole."""

    time: Time
    """When."""

    actor: Annotated[str, Field(examples=["A. Name"])]
    """Who; empty if that is not known."""

    source: SourceName
    """What it was done through."""

    peer: Annotated[str | None, Field(examples=["127.0.0.1"])]
    """Address it was asked from, or the user of the operating system; null if there is none."""

    action: Annotated[str, Field(examples=["alarm.shelved"])]
    """What was done."""

    object: Annotated[str, Field(examples=["U1:ujb_shaft_x:channel_not_ok"])]
    """What it was done to."""

    before: Annotated[dict[str, Any] | None, Field(examples=[{"state": "unacknowledged"}])]
    """What that was before; null where nothing is to be said."""

    after: Annotated[dict[str, Any] | None, Field(examples=[{"state": "shelved"}])]
    """What it was after."""

    reason: str
    """Why, in the words of the actor."""

    previous_hash: str
    """Hash of the entry before it, 64 hexadecimal digits."""

    hash: str
    """SHA-256 of all of this entry but itself."""


class AuditModel(ApiModel):
    """Some of the audit trail."""

    entries: list[AuditEntryModel]
    """Newest first."""

    next_before: int | None
    """What to give as ``before`` for those that are older; null if there are none."""

    head_error: str | None
    """Why the file beside the database that names the newest entry could not be written; null if
    it could. Entries are written all the same."""
