"""Grouping of readings by day and condition; robust standard deviations, medians, averages."""

import math
from dataclasses import dataclass, replace

import numpy as np

from core.arrays import BoolArray, FloatArray, IntArray, TimeArray
from core.condition.cells import CellGrid, FilmConditions
from core.units import DAY_NS


@dataclass(frozen=True, eq=False)
class Groups:
    """Groups of readings for the surface fit: median condition, median value, number and day.

    Each column is (n_groups,); days are counted from 1970.
    """

    conditions: FilmConditions
    value: FloatArray
    n_readings: IntArray
    day: IntArray

    def rows(self, wanted: BoolArray) -> "Groups":
        """Return the groups selected by a mask (n_groups,)."""
        n_readings, day = self.n_readings[wanted], self.day[wanted]
        return Groups(self.conditions.rows(wanted), self.value[wanted], n_readings, day)


def group_readings(
    time_ns: TimeArray, conditions: FilmConditions, value: FloatArray, grid: CellGrid
) -> Groups:
    """Return the readings grouped by day and by quarter of a condition cell.

    Readings of a day are correlated: they have the same water level, weather and warm-up. Cells are
    quartered because ln k (`value`) changes by 0.1 and more across a cell.
    """
    halves = replace(
        grid,
        eccentricity_width=grid.eccentricity_width / 2.0,
        temperature_width_c=grid.temperature_width_c / 2.0,
    )
    day = time_ns // DAY_NS
    keys, group = np.unique(np.vstack([day, halves.cells(conditions)]), axis=1, return_inverse=True)
    group = group.reshape(-1)
    angle = np.radians(conditions.attitude_deg)
    sines, cosines = (np.bincount(group, part(angle)) for part in (np.sin, np.cos))
    middle = FilmConditions(
        group_medians(conditions.eccentricity_ratio, group),
        group_medians(conditions.oil_temperature_c, group),
        np.degrees(np.arctan2(sines, cosines)),
    )
    return Groups(middle, group_medians(value, group), np.bincount(group), keys[0])


def group_medians(x: FloatArray, group: IntArray) -> FloatArray:
    """Return the median of x (n,) in each group, (n_groups,); `group` (n,) is the group index."""
    x = x[np.lexsort((x, group))]
    count = np.bincount(group)
    start = np.cumsum(count) - count
    return np.asarray((x[start + (count - 1) // 2] + x[start + count // 2]) / 2.0)


STD_PER_MAD = 1.4826
"""Ratio of standard deviation to median absolute deviation of a normal distribution."""

BISQUARE_LIMIT = 4.685
"""Number of standard deviations beyond which Tukey's bisquare weight is zero, for 95 % efficiency
with normal errors (Maronna, Martin and Yohai, Robust Statistics, 2.2)."""


def robust_std(deviation: FloatArray) -> float:
    """Return `STD_PER_MAD` times the median absolute value of deviations (n,); 0 if empty."""
    if deviation.size == 0:
        return 0.0
    return STD_PER_MAD * float(np.median(np.abs(deviation)))


def bisquare(standardised: FloatArray) -> FloatArray:
    """Return Tukey's bisquare weight of each deviation in standard deviations (n,).

    The weight is (1 - (x / `BISQUARE_LIMIT`)²)², and 0 beyond the limit.
    """
    rest = np.clip(1.0 - (standardised / BISQUARE_LIMIT) ** 2, 0.0, 1.0)
    return np.asarray(rest**2)


def absolute_quantile_std(deviation: FloatArray) -> float:
    """Return a standard deviation estimated from quantiles of absolute deviations (n,).

    It is the larger of the estimates from the 50 % and 75 % quantiles, scaled for a normal
    distribution; 0 if empty.
    """
    if deviation.size == 0:
        return 0.0
    half, three_quarters = np.quantile(np.abs(deviation), (0.5, 0.75))
    return float(max(STD_PER_MAD * half, three_quarters / 1.1503))


MEDIAN_READINGS = 5
"""Window length of the running median, which removes single spikes before averaging."""


def running_median(deviation: FloatArray) -> FloatArray:
    """Return the medians (n,) of each value and up to `MEDIAN_READINGS` - 1 values before it."""
    n = deviation.size
    if n < MEDIAN_READINGS:
        return np.array([np.median(deviation[: i + 1]) for i in range(n)], np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(deviation, MEDIAN_READINGS)
    start = [np.median(deviation[: i + 1]) for i in range(MEDIAN_READINGS - 1)]
    return np.concatenate([start, np.median(windows, axis=1)])


def ewma_weight(time_scale_h: float, reading_h: float) -> float:
    """Return α = 1 - exp(-reading_h / time_scale_h), the weight of a new reading in `ewma`."""
    return -math.expm1(-reading_h / time_scale_h)


def ewma(x: FloatArray, alpha: float) -> FloatArray:
    """Return the moving averages y[i] = (1 - α) y[i-1] + α x[i] of x (n,), with α = `alpha`.

    The first is α x[0]. Divided by the moving averages of ones, they are exponentially weighted
    means.
    """
    from scipy.signal import lfilter  # slow import, not needed at start-up

    return np.asarray(lfilter([alpha], [1.0, alpha - 1.0], x))
