"""Readings far from everything else that was learned, as those in another unit are.

A robust fit gives them no weight, so that they change nothing; they are counted to be mentioned.
"""

import math

import numpy as np
import numpy.typing as npt

from core.baseline.baseline import BearingBaseline
from core.baseline.stiffness_history import StiffnessHistory
from core.baseline.watched import watched_values

FAR = math.log(2.0)
"""A film of one condition is never twice as stiff as on another day: what is known of warm films
at one eccentricity and oil temperature differs by a few per cent (Brito et al., Tables 8 and 9)."""


def far_readings(
    history: StiffnessHistory, is_settled: npt.NDArray[np.bool_], baseline: BearingBaseline
) -> str | None:
    """Number of readings at least twice or at most half of what was learned, in words, if any.

    Parameters
    ----------
    is_settled : (n,)
        Whether the unit had settled in a steady state.
    """
    conditions, counts = history.conditions, []
    for learned in baseline.quantities:
        values = watched_values(history, learned.quantity, learned.direction)
        found = learned.compare(conditions, *values)
        deviation = found.deviation[is_settled & (found.place >= 0)]
        if n := int(np.sum(np.abs(deviation) >= FAR)):
            counts.append(f"{n} of {deviation.size} readings in {learned.direction}")
    if not counts:
        return None
    return f"{' and '.join(counts)} are at least twice or at most half of the others; a wrong unit?"
