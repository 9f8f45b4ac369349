"""Route for the newest motion of a shaft in its bearing, and the model of a motion."""

from typing import Annotated, Literal

import numpy as np
from fastapi import Response
from pydantic import BeforeValidator, Field

from core.arrays import FloatArray
from core.machine.unit import Bearing
from service.api.answers import rendered
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import duration
from service.api.routes.channels import NEWEST, NO_SAMPLES, count_of, held_blocks
from service.api.values import ApiModel, BearingAnswer, SampleRange, Time, listed
from service.live.samples import newest_blocks, sample_window
from service.live.status import HELD_S
from service.recordings.motion import (
    ShaftMotion,
    channels_for,
    motion_of,
)
from service.settings.core_values import machine_of

DECIMALS = 3
"""Number of decimals of displacements in µm, finer than a tenth of a converter count."""

SENSES = {1: "x_to_y", -1: "y_to_x", 0: "straight"}


def _rounded(values: FloatArray | None) -> list[float | None] | None:
    return None if values is None else listed(np.round(values, DECIMALS))


ShaftX = Annotated[list[float | None], BeforeValidator(_rounded), Field(validation_alias="x_um")]
ShaftY = Annotated[list[float | None], BeforeValidator(_rounded), Field(validation_alias="y_um")]


class EllipseModel(ApiModel):
    """Ellipse of the 1× orbit of the shaft, at the middle sample of the answer."""

    major_um_pk: float
    """Semi-major axis, µm."""

    minor_um_pk: float
    """Semi-minor axis, µm."""

    angle_deg: float
    """Angle of the major axis from the x axis towards the y axis, -90 to 90 degrees."""

    sense: Annotated[Literal["x_to_y", "y_to_x", "straight"], BeforeValidator(SENSES.get)]
    """Sense of rotation along the orbit; "straight" if the orbit is a line."""


class MotionOrder1Model(ApiModel):
    """1× component of the motion, from a tapered window of eight turns around each sample."""

    ellipse: EllipseModel

    frequency_hz: float
    """Running speed, Hz."""

    shaft_x_um: ShaftX
    """1× displacement in x for each sample, µm; null with too few neighbouring samples."""

    shaft_y_um: ShaftY
    """1× displacement in y for each sample, µm; null with too few neighbouring samples."""


class MotionModel(SampleRange, BearingAnswer):
    """Motion of a shaft relative to its bearing, at the full sampling rate."""

    start: Time
    received: Time | None
    n_samples: int

    shaft_x_um: ShaftX
    """Displacement in x without its mean, µm; null if the sample is missing or bad."""

    shaft_y_um: ShaftY
    """Displacement in y without its mean, µm; null if the sample is missing or bad."""

    clearance_um: float

    recording: Annotated[str | None, Field(examples=["U1-20261121T090312.400Z-shaft_x"])]
    """Name of the recording; null for the newest samples."""

    offset_s: float | None
    """Time of the first sample after the start of the recording, s; null for the newest samples."""

    total_s: float | None
    """Duration of the recording including gaps, s; null for the newest samples."""

    centre_um: Annotated[list[float] | None, Field(examples=[[-12.5, -61.0]])]
    """Mean position [x, y] of the shaft centre in the clearance circle, µm, from the gap reference
    in force; null if unknown."""

    speed_rpm: float | None
    """Running speed, r/min, from the key-phase, else from the slow channel; null if unknown."""

    order1: MotionOrder1Model | None
    """1× component of the motion; null if the speed is unknown or the samples are too few."""

    mark: Annotated[list[float] | None, BeforeValidator(_rounded), Field(validation_alias="marks")]
    """Positions of the key-phase pulses, in samples from the first sample, interpolated; null for a
    unit without a key-phase."""


def motion_model(unit: str, bearing: Bearing, motion: ShaftMotion, **origin: object) -> MotionModel:
    """Return the API model of the motion of a shaft in a bearing of a unit.

    `origin` are the fields `recording`, `offset_s`, `total_s` and `received` of the model.
    """
    return MotionModel.of(
        motion,
        motion.window,
        unit=unit,
        bearing=bearing.id,
        n_samples=motion.x_um.size,
        clearance_um=bearing.clearance_um,
        **origin,
    )


MAX_SAMPLES = 60_000
"""Maximum number of samples per direction in one answer: 100 s at 600 Hz, about 2 MB."""


def motion_router(context: Context) -> GuardedRouter:
    """Return the router for the newest motion."""
    router = subject_router("/units/{unit}/bearings", "bearing")

    @router.get("/{bearing}/motion", responses=NO_SAMPLES, response_model=MotionModel)
    async def motion(
        unit: UnitId,
        bearing: BearingId,
        seconds: Annotated[float, duration(HELD_S, NEWEST, examples=[5.0])] = 5.0,
    ) -> Response:
        """Return the newest motion of a shaft in its bearing, unfiltered and as 1× component."""
        settings, watched = context.units[unit], context.references.bearing(unit, bearing)
        blocks, received_ns = await held_blocks(context.live, settings)
        n_samples = count_of(seconds, blocks[-1].rate_hz, MAX_SAMPLES)

        def model() -> MotionModel:
            machine = machine_of(settings)
            ids = [channel.id for channel in machine.channels]
            rows = {id_: ids.index(id_) for id_ in channels_for(machine, watched)}
            held, first, n_held = newest_blocks(blocks, n_samples)
            found = motion_of(sample_window(held, rows, first, n_held), machine, watched)
            newest = {"recording": None, "offset_s": None, "total_s": None}
            return motion_model(unit, watched, found, **newest, received=received_ns)

        return await rendered(model)

    return router
