"""How far means of a day stray in each cell.

From a surface that has not seen them, and not alike everywhere: an error of the shaft's position
counts for more where stiffness rises steeply with eccentricity. A cell with few days leans on what
the slope of the surface makes of it: a² + b² slope², with a and b from all cells.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from core.arrays import FloatArray
from core.baseline.cell_table import CellTable
from core.baseline.groups import group_medians
from core.baseline.robust import STD_PER_MAD, robust_std

PRIOR_DAYS = 20.0
"""Days that the slope's word counts for. What strays, strays for days: twenty are few."""

MOST_STDS = 3.0
"""Deviations beyond this are taken for this, that wrong ones decide nothing."""

LEAST_SCATTER = 1e-6


def with_scatter(
    table: CellTable,
    slope: FloatArray,
    place: npt.NDArray[np.int64],
    day: npt.NDArray[np.int64],
    deviation: FloatArray,
) -> CellTable:
    """The table with the scatter of every cell.

    Parameters
    ----------
    slope : (n_cells,)
        Of the surface with eccentricity, in the middle of each cell.
    place, day, deviation : (n,)
        Of readings: cell in the table, day and deviation.
    """
    if place.size == 0:
        return table
    place, mean = _daily(place, day, deviation)
    expected = _by_slope(slope, place, mean)
    own, n_days = np.zeros(slope.size), np.zeros(slope.size)
    seen, numbered = np.unique(place, return_inverse=True)
    own[seen] = STD_PER_MAD * group_medians(np.abs(mean), numbered)
    n_days[seen] = np.bincount(numbered)
    variance = (n_days * own**2 + PRIOR_DAYS * expected**2) / (n_days + PRIOR_DAYS)
    return CellTable(
        tuple(
            replace(cell, scatter=max(float(scatter), LEAST_SCATTER))
            for cell, scatter in zip(table.cells, np.sqrt(variance), strict=True)
        )
    )


def _daily(
    place: npt.NDArray[np.int64], day: npt.NDArray[np.int64], deviation: FloatArray
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Cell and mean deviation of each day in each cell: what averaging leaves."""
    keys, group = np.unique(np.vstack([place, day]), axis=1, return_inverse=True)
    group = group.reshape(-1)
    return keys[0], np.asarray(np.bincount(group, deviation) / np.bincount(group))


def _by_slope(slope: FloatArray, place: npt.NDArray[np.int64], mean: FloatArray) -> FloatArray:
    """(n_cells,) scatter as a function of the slope alone."""
    most = MOST_STDS * robust_std(mean)
    design = np.stack([np.ones(mean.size), slope[place] ** 2], axis=1)
    (constant, per_slope), _ = nnls(design, np.minimum(np.abs(mean), most) ** 2)
    return np.asarray(np.sqrt(constant + per_slope * slope**2))
