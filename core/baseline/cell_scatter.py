"""How far readings stray in each cell.

From a surface that has not seen them, and not alike everywhere: an error of the shaft's position
counts for more where stiffness rises steeply with eccentricity. A cell with few days leans on those
of the same eccentricity, and these on all.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.cell_table import CellTable
from core.baseline.groups import group_medians
from core.baseline.robust import STD_PER_MAD

PRIOR_DAYS = 20.0
"""Days that the wider scatter counts for. What strays, strays for days: twenty are few."""

LEAST_SCATTER = 1e-6


def with_scatter(
    table: CellTable, place: npt.NDArray[np.int64], deviation: FloatArray
) -> CellTable:
    """The table with the scatter of every cell.

    Parameters
    ----------
    place, deviation : (n,)
        Of readings: cell in the table, and deviation.
    """
    if place.size == 0:
        return table
    size = np.abs(deviation)
    n_days = np.array([cell.n_days for cell in table.cells], np.float64)
    bins, of_cell = np.unique([cell.cell[0] for cell in table.cells], return_inverse=True)
    alike_days = np.bincount(of_cell, n_days).astype(np.float64)
    overall = np.full(bins.size, STD_PER_MAD * float(np.median(size)))
    alike = _drawn(_stds(size, of_cell[place], bins.size), alike_days, overall)
    each = _drawn(_stds(size, place, n_days.size), n_days, alike[of_cell])
    return CellTable(
        tuple(
            replace(cell, scatter=max(float(scatter), LEAST_SCATTER))
            for cell, scatter in zip(table.cells, each, strict=True)
        )
    )


def _stds(size: FloatArray, group: npt.NDArray[np.int64], n_groups: int) -> FloatArray:
    """(n_groups,) robust standard deviation; NaN of a group without readings."""
    found = np.full(n_groups, np.nan)
    present, numbered = np.unique(group, return_inverse=True)
    found[present] = STD_PER_MAD * group_medians(size, numbered)
    return found


def _drawn(std: FloatArray, days: FloatArray, wider: FloatArray) -> FloatArray:
    """Scatter drawn towards the wider one, the more the fewer days there are."""
    days = np.where(np.isnan(std), 0.0, days)
    own = np.nan_to_num(std)
    return np.asarray(np.sqrt((days * own**2 + PRIOR_DAYS * wider**2) / (days + PRIOR_DAYS)))
