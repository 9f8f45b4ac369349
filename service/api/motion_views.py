"""The motion of a shaft in the words of the API."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from core.arrays import FloatArray
from core.machine.unit import Bearing
from service.api.film_series_views import listed
from service.api.motion_models import EllipseModel, MotionModel, MotionOrder1Model
from service.recordings.motion import Order1, ShaftMotion
from service.runtime.times import rfc3339

DECIMALS = 3
"""Of samples, in µm: a tenth of a converter's count, and less."""

SENSES: dict[int, Literal["x_to_y", "y_to_x", "straight"]] = {
    1: "x_to_y",
    -1: "y_to_x",
    0: "straight",
}


@dataclass(frozen=True)
class MotionOrigin:
    """Where samples are from: memory, with their age, or a recording."""

    age_s: float | None = None
    recording: str | None = None
    offset_s: float | None = None
    total_s: float | None = None


def motion_model(
    unit: str, bearing: Bearing, motion: ShaftMotion, origin: MotionOrigin
) -> MotionModel:
    """A motion with where it is from."""
    stretch, marks = motion.stretch, motion.marks
    return MotionModel(
        unit=unit,
        bearing=bearing.id,
        recording=origin.recording,
        start=rfc3339(stretch.start_ns),
        offset_s=origin.offset_s,
        total_s=origin.total_s,
        age_s=origin.age_s,
        epoch=stretch.epoch,
        first_index=stretch.first_index,
        rate_hz=stretch.rate_hz,
        n_samples=motion.x_um.size,
        shaft_x_um=_rounded(motion.x_um),
        shaft_y_um=_rounded(motion.y_um),
        centre_um=None if motion.centre_um is None else list(motion.centre_um),
        clearance_um=bearing.clearance_um,
        speed_rpm=motion.speed_rpm,
        order1=None if motion.order1 is None else _order1(motion.order1),
        mark=None if marks is None else np.round(marks, DECIMALS).tolist(),
    )


def _order1(found: Order1) -> MotionOrder1Model:
    ellipse = found.ellipse
    return MotionOrder1Model(
        frequency_hz=found.frequency_hz,
        shaft_x_um=_rounded(found.x_um),
        shaft_y_um=_rounded(found.y_um),
        ellipse=EllipseModel(
            major_um_pk=ellipse.major_um_pk,
            minor_um_pk=ellipse.minor_um_pk,
            angle_deg=ellipse.angle_deg,
            sense=SENSES[ellipse.sense],
        ),
    )


def _rounded(values_um: FloatArray) -> list[float | None]:
    return listed(np.round(values_um, DECIMALS))
