"""Where the shaft runs in its bearing: centre, eccentricity ratio and attitude angle from gaps."""

import math
from dataclasses import dataclass

from core.quality import Reading, missing, worst


@dataclass(frozen=True)
class ShaftCentre:
    """Mean shaft position relative to the centred reference.

    Parameters
    ----------
    x_um, y_um
        Displacement along the bearing axes.
    eccentricity_ratio
        Distance from the centre over the radial clearance.
    attitude_angle_deg
        Direction of the displacement, from the positive x axis towards the positive y axis.
    """

    x_um: Reading
    y_um: Reading
    eccentricity_ratio: Reading
    attitude_angle_deg: Reading


def shaft_centre(
    gap_um: tuple[Reading, Reading], reference_um: tuple[float, float], clearance_um: float
) -> ShaftCentre:
    """Locate the shaft from two probes on the positive axes, whose gaps shrink as it approaches.

    Parameters
    ----------
    gap_um
        Mean gaps (x, y).
    reference_um
        The gaps with the shaft centred.
    clearance_um
        Radial clearance; must be positive.

    Raises
    ------
    ValueError
        If the clearance is not positive.
    """
    if not clearance_um > 0.0:
        raise ValueError(f"clearance must be positive, got {clearance_um} µm")
    x_um, y_um = (
        reading if reading.value is None else Reading(reference - reading.value, reading.quality)
        for reading, reference in zip(gap_um, reference_um, strict=True)
    )
    quality = worst((x_um.quality, y_um.quality))
    if x_um.value is None or y_um.value is None:
        nowhere = missing(quality.reason)
        return ShaftCentre(x_um, y_um, nowhere, nowhere)
    return ShaftCentre(
        x_um,
        y_um,
        Reading(math.hypot(x_um.value, y_um.value) / clearance_um, quality),
        Reading(math.degrees(math.atan2(y_um.value, x_um.value)), quality),
    )
