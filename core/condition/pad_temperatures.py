"""Pattern of the pad temperatures of a bearing: hottest pad, and first harmonic around the shaft.

The pad temperatures indicate the static radial load of a bearing (Brito et al., section 3.3.2): a
load in one direction heats the pads on that side.
"""

from collections.abc import Sequence

import numpy as np

from core.quality import NOT_MEASURED, Reading, Reason, missing, uncertain, worst

MEAN, EXCESS = "pad_temperature_mean_c", "pad_temperature_excess_k"
VECTOR, DIRECTION = "pad_temperature_vector_k", "pad_temperature_direction_deg"

MAX_CONDITION = 5.0
"""Largest condition number of the fit; above it, the pads cover too small a part of the circle."""


def pad_pattern(pads: Sequence[tuple[Reading, float | None]]) -> dict[str, Reading]:
    """Return the pattern of pad temperatures, by quantity of the catalogue.

    The pattern is the mean, the difference of the hottest pad from the mean, and amplitude and
    direction of the first harmonic ``T(θ) = mean + a cos(θ - direction)``, by least squares. It is
    uncertain if a pad has no reading, and missing with fewer than two pads. The harmonic also needs
    the angles of all pads, and three pads with readings that lie around the shaft.

    Parameters
    ----------
    pads
        Temperature of each pad in °C, and its angle in degrees from x towards y, None if unknown.
    """
    read = [(reading.value, angle) for reading, angle in pads if reading.value is not None]
    if len(read) < 2:
        reason = worst(reading.quality for reading, _ in pads).reason if pads else None
        nothing = NOT_MEASURED if reason in (None, Reason.OK) else missing(reason)
        return dict.fromkeys((MEAN, EXCESS, VECTOR, DIRECTION), nothing)
    qualities = [reading.quality for reading, _ in pads if reading.value is not None]
    quality = worst([*qualities, *([uncertain(Reason.REDUCED_PROBES)] * (len(read) < len(pads)))])
    temperature_c = np.array([value for value, _ in read])
    mean_c = float(temperature_c.mean())
    found = {
        MEAN: Reading(mean_c, quality),
        EXCESS: Reading(float(temperature_c.max()) - mean_c, quality),
        **dict.fromkeys((VECTOR, DIRECTION), NOT_MEASURED),
    }
    angles_deg = [angle for _, angle in read if angle is not None]
    if len(angles_deg) < max(3, len(read)):
        return found
    theta = np.deg2rad(angles_deg)
    terms = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], axis=1)
    if np.linalg.cond(terms) > MAX_CONDITION:
        return found | dict.fromkeys((VECTOR, DIRECTION), missing(Reason.REDUCED_PROBES))
    _, *parts = np.linalg.lstsq(terms, temperature_c, rcond=None)[0].tolist()
    vector = complex(*parts)
    return found | {
        VECTOR: Reading(abs(vector), quality),
        DIRECTION: Reading(float(np.angle(vector, deg=True)), quality),
    }
