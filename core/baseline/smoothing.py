"""Means of deviations over running hours: spikes taken out, then averages that forget.

A deviation that is to count must last. Each is first replaced by the median of the newest five, so
that one or two wrong readings never count; then it enters exponentially weighted means with
several time constants, in which the i-th newest counts with λ (1 - λ)^i. Only readings that are
counted move them: hours without readings, or with readings that say nothing, neither add nor take
away. The streaming and the whole-history form do the same arithmetic and agree to the last bit.
"""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray

MEDIAN_READINGS = 5
"""Of which the median is taken."""


def forgetting(time_scale_h: float, reading_h: float) -> float:
    """Weight λ of the newest reading in the mean over a time scale."""
    return -math.expm1(-reading_h / time_scale_h)


@dataclass(frozen=True)
class Newest:
    """The newest deviations, oldest first, of which the median is taken."""

    deviations: tuple[float, ...] = ()

    def step(self, deviation: float) -> "Newest":
        """Take in one more."""
        return Newest((*self.deviations, deviation)[-MEDIAN_READINGS:])

    @property
    def median(self) -> float:
        """Median of the newest; until there are enough, of all."""
        return float(np.median(self.deviations))


NOTHING_NEW = Newest()


def running_median(deviation: FloatArray) -> FloatArray:
    """(n,) what `Newest.median` gives step by step."""
    n = deviation.size
    if n < MEDIAN_READINGS:
        return np.array([np.median(deviation[: i + 1]) for i in range(n)], np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(deviation, MEDIAN_READINGS)
    start = [np.median(deviation[: i + 1]) for i in range(MEDIAN_READINGS - 1)]
    return np.concatenate([start, np.median(windows, axis=1)])


def forgetting_sum(x: FloatArray, forgotten: float) -> FloatArray:
    """(n,) sums in which the newest of x has weight `forgotten`."""
    from scipy.signal import lfilter  # slow to load, and not needed to begin

    return np.asarray(lfilter([forgotten], [1.0, forgotten - 1.0], x))


def forgetting_step(total: float, x: float, forgotten: float) -> float:
    """Next value of `forgetting_sum`, in the order of its arithmetic."""
    return total * (1.0 - forgotten) + forgotten * x
