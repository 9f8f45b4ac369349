"""Grouping of readings by day and condition; robust scales, medians and weighted means."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.condition.cells import CellGrid, FilmConditions
from core.units import DAY_NS


@dataclass(frozen=True, eq=False)
class Groups:
    """Points (n,) that a surface is fitted to: medians of readings, their number and their day."""

    conditions: FilmConditions
    value: FloatArray
    n_readings: npt.NDArray[np.int64]
    day: npt.NDArray[np.int64]

    def rows(self, wanted: npt.NDArray[np.bool_]) -> "Groups":
        """Some of the groups."""
        return Groups(
            self.conditions.rows(wanted),
            self.value[wanted],
            self.n_readings[wanted],
            self.day[wanted],
        )


def group_readings(
    time_ns: TimeArray, conditions: FilmConditions, value: FloatArray, grid: CellGrid
) -> Groups:
    """Group the readings of one day in one quarter of a cell.

    Readings within a day share water, weather and warm-up. Quarters are used because ln k changes
    by a tenth and more across a cell.
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
    sines, cosines = (_group_sums(part(angle), group) for part in (np.sin, np.cos))
    middle = FilmConditions(
        group_medians(conditions.eccentricity_ratio, group),
        group_medians(conditions.oil_temperature_c, group),
        np.degrees(np.arctan2(sines, cosines)),
    )
    return Groups(middle, group_medians(value, group), np.bincount(group), keys[0])


def group_medians(x: FloatArray, group: npt.NDArray[np.int64]) -> FloatArray:
    """Median of x in every group; groups are numbered from zero without gaps."""
    x = x[np.lexsort((x, group))]
    count = np.bincount(group)
    start = np.cumsum(count) - count
    return np.asarray((x[start + (count - 1) // 2] + x[start + count // 2]) / 2.0)


def _group_sums(x: FloatArray, group: npt.NDArray[np.int64]) -> FloatArray:
    return np.bincount(group, x).astype(np.float64)


STD_PER_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

BISQUARE_LIMIT = 4.685
"""Standard deviations beyond which Tukey's bisquare is zero; 95 % efficient for normal values
(Maronna, Martin and Yohai, Robust Statistics, 2.2)."""


def robust_std(deviation: FloatArray) -> float:
    """Standard deviation about zero, from the median of the absolute deviations."""
    if deviation.size == 0:
        return 0.0
    return STD_PER_MAD * float(np.median(np.abs(deviation)))


def bisquare(standardised: FloatArray) -> FloatArray:
    """Weight of each standardised deviation: 1 at zero, 0 beyond `BISQUARE_LIMIT`."""
    rest = np.clip(1.0 - (standardised / BISQUARE_LIMIT) ** 2, 0.0, 1.0)
    return np.asarray(rest**2)


def absolute_quantile_std(deviation: FloatArray) -> float:
    """Standard deviation about zero: the larger estimate of middle half and three quarters."""
    if deviation.size == 0:
        return 0.0
    half, three_quarters = np.quantile(np.abs(deviation), (0.5, 0.75))
    return float(max(STD_PER_MAD * half, three_quarters / 1.1503))


MEDIAN_READINGS = 5
"""Number of newest deviations whose median is averaged, so that single spikes do not count."""


def running_median(deviation: FloatArray) -> FloatArray:
    """(n,) median of the newest `MEDIAN_READINGS`; until there are enough, of all."""
    n = deviation.size
    if n < MEDIAN_READINGS:
        return np.array([np.median(deviation[: i + 1]) for i in range(n)], np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(deviation, MEDIAN_READINGS)
    start = [np.median(deviation[: i + 1]) for i in range(MEDIAN_READINGS - 1)]
    return np.concatenate([start, np.median(windows, axis=1)])


def ewma_weight(time_scale_h: float, reading_h: float) -> float:
    """Weight α of the newest reading in an exponentially weighted mean over a time scale."""
    return -math.expm1(-reading_h / time_scale_h)


def ewma(x: FloatArray, alpha: float) -> FloatArray:
    """(n,) exponentially weighted sums; `ewma_step` for all of x, with the same arithmetic."""
    from scipy.signal import lfilter  # slow to import, and not needed at start

    return np.asarray(lfilter([alpha], [1.0, alpha - 1.0], x))


def ewma_step(total: float, x: float, alpha: float) -> float:
    """Exponentially weighted sum after one more value."""
    return total * (1.0 - alpha) + alpha * x
