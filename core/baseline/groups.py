"""Readings of one day under one condition, drawn together into one point."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.condition.cells import CellGrid
from core.condition.film_conditions import FilmConditions
from core.units import NS_PER_S

DAY_NS = 86_400 * NS_PER_S


@dataclass(frozen=True, eq=False)
class Groups:
    """Points that a surface is fitted to.

    Parameters
    ----------
    value : (n,)
        Median of the readings.
    n_readings, day : (n,)
        How many there are, and days since 1970.
    """

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
    """Draw together what lies in one quarter of a cell on one day.

    A day is the unit that repeats: readings within it see the same water, weather and warm-up. A
    quarter, because ln k changes by a tenth and more across a cell.
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
    """Median of x in every group; groups are numbered from zero without holes."""
    x = x[np.lexsort((x, group))]
    count = np.bincount(group)
    start = np.cumsum(count) - count
    return np.asarray((x[start + (count - 1) // 2] + x[start + count // 2]) / 2.0)


def _group_sums(x: FloatArray, group: npt.NDArray[np.int64]) -> FloatArray:
    return np.bincount(group, x).astype(np.float64)
