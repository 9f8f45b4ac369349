"""Columns of a history that have a baseline."""

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import Watched
from core.baseline.stiffness_history import DIRECTIONS, StiffnessHistory


def watched_values(
    history: StiffnessHistory, quantity: Watched, direction: str
) -> tuple[FloatArray, FloatArray]:
    """Logarithm of a quantity and its random uncertainty.

    Returns
    -------
    (n,), (n,)
        NaN where there is no number. The uncertainty of amplitudes is not known and given as zero:
        it is part of the scatter that is learned.
    """
    row = DIRECTIONS.index(direction)
    if quantity is Watched.STIFFNESS:
        return history.ln_k[row], np.nan_to_num(history.u_random[row])
    amplitude = history.shaft_um_pk if quantity is Watched.SHAFT else history.bearing_um_pk
    is_there = amplitude[row] > 0.0
    value = np.full(len(history), np.nan)
    value[is_there] = np.log(amplitude[row][is_there])
    return value, np.zeros(len(history))
