"""What the API says of reference vectors of 1×."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.alarm_requests import Actor, Comment
from service.api.models import ApiModel, RequestModel, Time

StateName = Literal[
    "unknown", "standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"
]
PlaceName = Literal["shaft_x", "shaft_y", "bearing_x", "bearing_y"]


class VectorModel(ApiModel):
    """A 1× vector."""

    amplitude_um_pk: Annotated[float, Field(examples=[61.2])]
    """Length, µm zero-to-peak."""

    phase_deg: Annotated[float | None, Field(examples=[134.8])]
    """Degrees by which it leads the key-phase; null where no key-phase says so: then only a change
    of length is noticed."""


class Order1ReferenceModel(ApiModel):
    """Where the 1× vectors of a bearing were when all was well."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    state: StateName
    """Operating state in which it holds."""

    vectors: dict[PlaceName, VectorModel]
    """By place."""

    set: Time
    """When it was set."""

    author: str
    """Who set it."""

    note: str | None
    """What was said about it."""


class TakeReferenceModel(RequestModel):
    """That somebody calls the machine, as it runs now, well."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    note: Comment = ""
    """What to remember, at most 500 printable characters."""
