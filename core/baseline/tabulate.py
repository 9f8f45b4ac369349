"""Calculation of the cell table of a baseline: statistics and support of each cell."""

import itertools
from collections import Counter
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.baseline.cell_table import (
    NODES,
    CellStatistics,
    CellTable,
    Support,
    cells_between,
    neighbourhood,
)
from core.baseline.grouping import Groups, group_medians
from core.baseline.settings import BaselineSettings
from core.baseline.surface import Surface
from core.baseline.surface_fit import MIN_SCATTER, Fit
from core.condition.cells import Cell, CellGrid, FilmConditions

BELIEVED = 0.1
"""Smallest robust weight with which a group counts towards the support of a cell."""


@dataclass(frozen=True)
class _Contents:
    """Summary of a cell's readings: numbers of readings and days, medians of ln k and condition."""

    n_readings: int
    n_days: int
    location: float
    eccentricity_ratio: float
    oil_temperature_c: float
    attitude_deg: float


def tabulate(
    conditions: FilmConditions,
    value: FloatArray,
    groups: Groups,
    fit: Fit,
    settings: BaselineSettings,
) -> CellTable:
    """Return the table of cells with readings, and of cells between them; `value` (n,) is ln k."""
    contents = _seen(conditions, value, groups, fit, settings.grid)
    enough = {
        cell
        for cell, content in contents.items()
        if content.n_readings >= settings.min_readings and content.n_days >= settings.min_days
    }
    between = cells_between(frozenset(enough), settings.borrowing_reach)
    between |= {cell for cell in contents if _may_borrow(cell, contents, settings)}
    for cell in sorted(between - set(contents)):
        contents[cell] = _unseen(cell, enough, contents, fit.surface, settings.grid)
    middle = [
        (c.eccentricity_ratio, c.oil_temperature_c, c.attitude_deg) for c in contents.values()
    ]
    std = fit.std(FilmConditions(*np.array(middle).T))
    nodes = _node_std(contents, fit, settings.grid)
    return CellTable(
        tuple(
            CellStatistics(
                **vars(content),
                cell=cell,
                scatter=max(float(np.median(fit.group_std)), MIN_SCATTER),  # preliminary
                lasting=0.0,
                surface_std=float(std[row]),
                node_std=nodes[row],
                support=_support(cell, enough, between, std[row] <= settings.max_surface_std),
            )
            for row, (cell, content) in enumerate(contents.items())
        )
    )


def _may_borrow(cell: Cell, contents: dict[Cell, _Contents], settings: BaselineSettings) -> bool:
    if contents[cell].n_readings < settings.borrowing_readings:
        return False
    around = [contents[other].n_days for other in neighbourhood(cell) if other in contents]
    return sum(around) >= settings.min_days


def _support(cell: Cell, enough: set[Cell], between: frozenset[Cell], is_sure: np.bool_) -> Support:
    if not is_sure:
        return Support.NONE
    if cell in enough:
        return Support.OWN
    return Support.BORROWED if cell in between else Support.NONE


def _seen(
    conditions: FilmConditions, value: FloatArray, groups: Groups, fit: Fit, grid: CellGrid
) -> dict[Cell, _Contents]:
    """Return the contents of each cell that has readings."""
    cells, place = np.unique(grid.cells(conditions), axis=1, return_inverse=True)
    place = place.reshape(-1)
    names: list[Cell] = list(zip(*cells.tolist(), strict=True))
    n_readings, n_days = _support_counts(groups, fit, grid)
    angle = np.radians(np.nan_to_num(conditions.attitude_deg))
    sines, cosines = (np.bincount(place, part(angle)) for part in (np.sin, np.cos))
    columns = (
        [n_readings[cell] for cell in names],
        [n_days[cell] for cell in names],
        group_medians(value, place).tolist(),
        group_medians(conditions.eccentricity_ratio, place).tolist(),
        group_medians(conditions.oil_temperature_c, place).tolist(),
        np.degrees(np.arctan2(sines, cosines)).tolist(),
    )
    return dict(zip(names, map(_Contents, *columns), strict=True))


def _unseen(
    cell: Cell,
    enough: set[Cell],
    contents: dict[Cell, _Contents],
    surface: Surface,
    grid: CellGrid,
) -> _Contents:
    """Return the contents of a cell without readings, from its centre and the nearest cell."""
    nearest = min(
        sorted(enough), key=lambda other: sum(abs(a - b) for a, b in zip(cell, other, strict=True))
    )
    e, oil_c = grid.centre(cell)[:2]
    attitude_deg = contents[nearest].attitude_deg
    height = float(surface.at(FilmConditions.one(e, oil_c, attitude_deg))[0])
    return _Contents(0, 0, height, e, oil_c, attitude_deg)


def _node_std(contents: dict[Cell, _Contents], fit: Fit, grid: CellGrid) -> list[tuple[float, ...]]:
    """Return `CellStatistics.node_std` of each cell: the uncertainty at its nodes."""
    low = np.array([cell[:2] for cell in contents], np.float64)
    attitude_deg = np.array([content.attitude_deg for content in contents.values()])
    along = np.linspace(0.0, 1.0, NODES)
    nodes = (
        FilmConditions(
            (low[:, 0] + along_e) * grid.eccentricity_width,
            (low[:, 1] + along_t) * grid.temperature_width_c,
            attitude_deg,
        )
        for along_e, along_t in itertools.product(along, along)
    )
    return list(zip(*(fit.std(node).tolist() for node in nodes), strict=True))


def _support_counts(
    groups: Groups, fit: Fit, grid: CellGrid
) -> tuple[Counter[Cell], Counter[Cell]]:
    """Return the numbers of readings and days of each cell, without rejected groups."""
    believed = groups.rows(fit.robust_weight >= BELIEVED)
    cells = list(zip(*grid.cells(believed.conditions).tolist(), strict=True))
    n_readings: Counter[Cell] = Counter()
    for cell, n in zip(cells, believed.n_readings.tolist(), strict=True):
        n_readings[cell] += n
    days = set(zip(cells, believed.day.tolist(), strict=True))
    return n_readings, Counter(cell for cell, _ in days)
