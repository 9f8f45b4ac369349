"""What the API answers about the motion of a shaft in its bearing, sample by sample."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, Time


class EllipseModel(ApiModel):
    """The path at running speed alone, in the middle of the stretch."""

    major_um_pk: float
    """Longer half axis."""

    minor_um_pk: float
    """Shorter half axis."""

    angle_deg: float
    """Of the longer one, from x towards y, -90 to 90."""

    sense: Literal["x_to_y", "y_to_x", "straight"]
    """Which way the shaft runs round it."""


class MotionOrder1Model(ApiModel):
    """The part of the motion at running speed, from a taper of eight turns around each sample."""

    frequency_hz: float
    """Running speed."""

    shaft_x_um: list[float | None]
    """Along x; null where too few samples lie around."""

    shaft_y_um: list[float | None]
    """Along y, likewise."""

    ellipse: EllipseModel
    """Its path."""


class MotionModel(ApiModel):
    """Motion of a shaft relative to its bearing; not one sample is left out."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    recording: Annotated[str | None, Field(examples=["U1-20261121T090312.400Z-shaft_x"])]
    """Name of the recording it is out of; null for the newest samples."""

    start: Time
    """Time of the first sample."""

    offset_s: float | None
    """From the first sample of the recording to the first of these; null for the newest samples."""

    total_s: float | None
    """Length of the recording, holes included, likewise."""

    age_s: float | None
    """Of the newest samples, seconds since they arrived; null out of a recording."""

    epoch: int
    """Changes when the device restarts its count."""

    first_index: int
    """Index of the first sample."""

    rate_hz: float
    """Samples per second."""

    n_samples: int
    """In each direction."""

    shaft_x_um: list[float | None]
    """Displacement along x, mean removed; null where a sample never arrived or is bad."""

    shaft_y_um: list[float | None]
    """Along y, likewise."""

    centre_um: Annotated[list[float] | None, Field(examples=[[-12.5, -61.0]])]
    """Mean position [x, y] in the clearance circle, by the reference now in force; null where the
    gaps do not tell it."""

    clearance_um: float
    """Radius of the clearance circle."""

    speed_rpm: float | None
    """Running speed, from the key-phase, else from the slow channel."""

    order1: MotionOrder1Model | None
    """At running speed alone; null without a speed, or with too few samples."""

    mark: list[float] | None
    """Where the key-phase mark passes, in samples from the first, between samples too; null for a
    unit without a key-phase."""
