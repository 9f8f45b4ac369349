"""Filling the table of cells: what each has seen, and whether that is enough."""

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.cell_table import CellStatistics, CellTable, Support, lies_between
from core.baseline.fit import Fit
from core.baseline.groups import Groups, group_medians
from core.baseline.robust import STD_PER_MAD, robust_std
from core.baseline.settings import BaselineSettings
from core.condition.cells import CellArray, CellGrid
from core.condition.film_conditions import FilmConditions

PRIOR_DAYS = 5.0
"""Days that the scatter over all cells counts for in the scatter of one."""

BELIEVED = 0.1
"""Robust weight from which on a group counts as support."""


def tabulate(
    conditions: FilmConditions,
    value: FloatArray,
    residual: FloatArray,
    groups: Groups,
    fit: Fit,
    settings: BaselineSettings,
) -> CellTable:
    """Statistics and support of every cell with readings.

    Parameters
    ----------
    value, residual : (n,)
        Of the readings.
    """
    grid = settings.grid
    cells, place = np.unique(grid.cells(conditions), axis=1, return_inverse=True)
    place = place.reshape(-1)
    n_readings, n_days = support_counts(groups, fit, grid, cells)
    raw = STD_PER_MAD * group_medians(np.abs(residual), place)
    overall = robust_std(residual)
    scatter = np.sqrt((n_days * raw**2 + PRIOR_DAYS * overall**2) / (n_days + PRIOR_DAYS))
    std = fit.std(fit.surface.shape.design(_centres(grid, cells)))
    support = _supports(cells, n_readings, n_days, std, settings)
    location = group_medians(value, place)
    return CellTable(
        tuple(
            CellStatistics(
                cell=tuple(int(i) for i in cells[:, row]),
                n_readings=int(n_readings[row]),
                n_days=int(n_days[row]),
                location=float(location[row]),
                scatter=float(max(scatter[row], 1e-6)),
                surface_std=float(std[row]),
                support=support[row],
            )
            for row in range(cells.shape[1])
        )
    )


def support_counts(
    groups: Groups, fit: Fit, grid: CellGrid, cells: CellArray
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(n_cells,) readings and days of each cell, without what the fit has rejected."""
    believed = groups.rows(fit.robust_weight >= BELIEVED)
    place = find_columns(grid.cells(believed.conditions), cells)
    days = np.unique(np.vstack([place, believed.day]), axis=1)[0]
    n = cells.shape[1]
    n_readings = np.bincount(place, believed.n_readings, n).astype(np.int64)
    return n_readings, np.bincount(days, minlength=n)


def find_columns(wanted: CellArray, cells: CellArray) -> npt.NDArray[np.int64]:
    """(n,) which column of `cells`, sorted as by `np.unique`, each wanted column is."""
    low = np.minimum(cells.min(axis=1), wanted.min(axis=1, initial=0))[:, np.newaxis]
    size = tuple(np.maximum(cells.max(axis=1), wanted.max(axis=1, initial=0)) - low[:, 0] + 1)
    flat = np.ravel_multi_index(tuple(cells - low), size)
    found = np.searchsorted(flat, np.ravel_multi_index(tuple(wanted - low), size))
    return np.asarray(found, np.int64)


def _centres(grid: CellGrid, cells: CellArray) -> FilmConditions:
    centres = np.array([grid.centre(tuple(cell)) for cell in cells.T.tolist()]).T
    attitude_deg = centres[2] if grid.has_attitude else np.zeros(cells.shape[1])
    return FilmConditions(centres[0], centres[1], attitude_deg)


def _supports(
    cells: CellArray,
    n_readings: npt.NDArray[np.int64],
    n_days: npt.NDArray[np.int64],
    std: FloatArray,
    settings: BaselineSettings,
) -> list[Support]:
    is_sure = std <= settings.max_surface_std
    is_own = (n_readings >= settings.min_readings) & (n_days >= settings.min_days) & is_sure
    names = [tuple(cell) for cell in cells.T.tolist()]
    own = frozenset(name for name, yes in zip(names, is_own, strict=True) if yes)
    may_borrow = (n_readings >= settings.borrowing_readings) & is_sure
    return [
        Support.OWN
        if is_own[row]
        else Support.BORROWED
        if may_borrow[row] and lies_between(name, own)
        else Support.NONE
        for row, name in enumerate(names)
    ]
