"""How far means of a day stray in each cell, and how much of it lasts.

From a surface that has not seen them, and not alike everywhere: an error of the shaft's position
counts for more where stiffness rises steeply with eccentricity. A cell with few days leans on what
the slope of the surface makes of it. Position drifts for weeks, so that its part does not average
out; what is left over does.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.cell_table import CellTable
from core.baseline.groups import group_medians
from core.baseline.robust import STD_PER_MAD
from core.baseline.slope_scatter import LEAST_SCATTER, slope_scatter

PRIOR_DAYS = 20.0
"""Days that the slope's word counts for. What strays, strays for days: twenty are few."""

MOST_LASTING = 0.95
"""Share of the scatter: something always averages out."""


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
    model = slope_scatter(slope[place], mean)
    expected = model.variance(slope)
    own, n_days = _own(place, mean, slope.size)
    variance = (n_days * own**2 + PRIOR_DAYS * expected) / (n_days + PRIOR_DAYS)
    scatter = np.maximum(np.sqrt(variance), LEAST_SCATTER)
    lasting = scatter * np.minimum(np.sqrt(model.lasting(slope) / expected), MOST_LASTING)
    return CellTable(
        tuple(
            replace(cell, scatter=one, lasting=part)
            for cell, one, part in zip(table.cells, scatter.tolist(), lasting.tolist(), strict=True)
        )
    )


def _own(
    place: npt.NDArray[np.int64], mean: FloatArray, n_cells: int
) -> tuple[FloatArray, FloatArray]:
    """(n_cells,) scatter of a cell's own days, and how many there are."""
    own, n_days = np.zeros(n_cells), np.zeros(n_cells)
    seen, numbered = np.unique(place, return_inverse=True)
    own[seen] = STD_PER_MAD * group_medians(np.abs(mean), numbered)
    n_days[seen] = np.bincount(numbered)
    return own, n_days


def _daily(
    place: npt.NDArray[np.int64], day: npt.NDArray[np.int64], deviation: FloatArray
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Cell and mean deviation of each day in each cell: what averaging leaves."""
    keys, group = np.unique(np.vstack([place, day]), axis=1, return_inverse=True)
    group = group.reshape(-1)
    return keys[0], np.asarray(np.bincount(group, deviation) / np.bincount(group))
