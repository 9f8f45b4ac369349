"""What the API says of a bearing as it is described, and of its references."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, Time

MicrometrePair = Annotated[
    list[float], Field(min_length=2, max_length=2, examples=[[1998.5, 2003.1]])
]
SetTime = Annotated[Time, Field(description="When it was set.")]
Author = Annotated[str, Field(description="Who set it.", examples=["A. Name"])]
Note = Annotated[
    str, Field(description="What the author has to say.", examples=["after the overhaul"])
]


class ReferenceModel(ApiModel):
    """Where the reference in force comes from."""

    source: Literal["plant_file", "given", "measured"]
    """The plant file, numbers given by hand, or the measured mean gaps when it was set."""

    set: SetTime | None
    """When it was set; null for the plant file's."""

    author: Author | None
    """Who set it; null for the plant file's."""

    note: Note | None
    """What the author had to say, if anything."""


class SetReferenceModel(ApiModel):
    """A reference as it was once set."""

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] with the shaft centred."""

    opposite_reference_um: MicrometrePair | None
    """The same of the probes across the shaft; null without such probes."""

    source: Literal["given", "measured"]
    """Numbers given by hand, or the measured mean gaps when it was set."""

    set: Time
    """When it was set."""

    author: Author
    """Who set it."""

    note: Note | None
    """What the author had to say, if anything."""


class BearingModel(ApiModel):
    """A bearing as configured, with the reference that is in force."""

    unit: str
    """Unit."""

    id: str
    """Bearing."""

    bracket_stiffness_n_per_m: float
    """Radial stiffness of the bracket."""

    clearance_um: float
    """Radial clearance in operation."""

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] with the shaft centred, as in force."""

    opposite_reference_um: MicrometrePair | None
    """The same of the probes across the shaft; null without such probes."""

    reference: ReferenceModel
    """Where these gaps come from."""

    channels: dict[str, str]
    """Channel ids of shaft_x, shaft_y, bearing_x and bearing_y."""
