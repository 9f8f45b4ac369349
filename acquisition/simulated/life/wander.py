"""How quantities move by themselves: wander, levels that stay, first-order lag."""

import math

import numpy as np

from core.arrays import FloatArray


def wander(
    random: np.random.Generator, n: int, step_s: float, time_s: float, rms: float
) -> FloatArray:
    """First-order Gauss-Markov wander about zero, stationary from the first row on."""
    import scipy.signal  # slow to load, and not needed to begin

    memory = math.exp(-step_s / time_s)
    fresh = random.standard_normal(n)
    fresh[1:] *= math.sqrt(1.0 - memory**2)
    return np.asarray(rms * scipy.signal.lfilter([1.0], [1.0, -memory], fresh))


def change_rows(
    random: np.random.Generator, n: int, step_s: float, interval_s: float
) -> FloatArray:
    """(n,) number of the level that holds, counting from 0; changes come by chance.

    Parameters
    ----------
    interval_s
        Mean time between two changes.
    """
    return np.cumsum(random.random(n) < step_s / interval_s).astype(np.float64)


def held(levels: FloatArray, which: FloatArray) -> FloatArray:
    """Level that holds at each row."""
    return np.asarray(levels[which.astype(np.int64)])


def lagged(target: FloatArray, time_s: FloatArray, step_s: float, initial: float) -> FloatArray:
    """First-order lag behind a target: τ dy/dt = target − y, exact for targets held per step.

    Parameters
    ----------
    target, time_s : (n,)
        The time constant may change from row to row, but should seldom.
    initial
        Value before the first row.
    """
    import scipy.signal  # slow to load, and not needed to begin

    followed = np.empty_like(target)
    edges = np.flatnonzero(np.diff(time_s)) + 1
    value = initial
    for piece in np.split(np.arange(target.size), edges):
        memory = math.exp(-step_s / float(time_s[piece[0]]))
        followed[piece], _ = scipy.signal.lfilter(
            [1.0 - memory], [1.0, -memory], target[piece], zi=[memory * value]
        )
        value = float(followed[piece[-1]])
    return followed
