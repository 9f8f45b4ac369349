"""Table of the condition cells of a baseline: scatter, uncertainty and support of each cell."""

import itertools
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from core.arrays import FloatArray, IntArray
from core.condition.cells import Cell, CellArray, FilmConditions

NODES = 3
"""Number of grid points along each axis of a cell, including both edges."""


class Support(StrEnum):
    """Support of a cell: enough own readings, readings of nearby cells (borrowed), or none.

    New readings in a cell without support are not judged.
    """

    NONE = "none"
    BORROWED = "borrowed"
    OWN = "own"


@dataclass(frozen=True)
class CellStatistics:
    """Statistics of one condition cell. Raises `ValueError` if a value is out of its range.

    Parameters
    ----------
    location
        Median of ln stiffness.
    scatter
        Robust standard deviation of readings about the surface. With few days it is shrunk towards
        a model over all cells.
    lasting
        Part of the scatter that averaging does not reduce. Errors of the shaft position cause it:
        they last for weeks, and change the expected stiffness where the surface is steep.
    surface_std
        Standard uncertainty of the surface at the median condition of the cell's readings.
    node_std
        Standard uncertainty of the surface at `NODES` by `NODES` nodes: all temperatures at the
        lowest eccentricity first. It is larger at edges that have no readings nearby.
    eccentricity_ratio, oil_temperature_c, attitude_deg
        Medians over the cell's readings; an unknown attitude counts as 0.
    """

    cell: Cell
    n_readings: int
    n_days: int
    location: float
    scatter: float
    lasting: float
    surface_std: float
    node_std: tuple[float, ...]
    eccentricity_ratio: float
    oil_temperature_c: float
    attitude_deg: float
    support: Support

    def __post_init__(self) -> None:
        if min(self.n_readings, self.n_days) < 0:
            raise ValueError(
                f"n_readings = {self.n_readings} and n_days = {self.n_days} must not be below 0"
            )
        if not (self.scatter > 0.0 and self.surface_std >= 0.0):
            found = f"{self.scatter:g} and {self.surface_std:g}"
            raise ValueError(f"scatter must be above 0 and surface_std not below 0, got {found}")
        if not 0.0 <= self.lasting < self.scatter:
            raise ValueError(
                f"lasting = {self.lasting:g} must be 0 or more and below scatter = {self.scatter:g}"
            )
        if len(self.node_std) != NODES**2 or not min(self.node_std) >= 0.0:
            found = ", ".join(f"{std:g}" for std in self.node_std)
            raise ValueError(f"node_std must be {NODES**2} numbers >= 0, got {found}")


@dataclass(frozen=True)
class CellTable:
    """Table of the condition cells of a baseline, one row per cell.

    Raises `ValueError` if a cell is repeated, or the cells differ in the number of axes.
    """

    cells: tuple[CellStatistics, ...]

    def __post_init__(self) -> None:
        names = [cell.cell for cell in self.cells]
        if len(set(names)) < len(names):
            raise ValueError(f"cells must be unique, got {len(names) - len(set(names))} repeated")
        if len({len(name) for name in names}) > 1:
            raise ValueError("all cells must have the same number of axes, 2 or 3")

    def find(self, cells: CellArray) -> IntArray:
        """Return the table row of each of n cells (n,); -1 for a missing or unsupported cell."""
        columns = zip(*cells.tolist(), strict=True)
        return np.array([self._rows.get(cell, -1) for cell in columns], np.int64)

    @cached_property
    def scatter(self) -> FloatArray:
        """Standard deviation of readings about the surface in each cell (n_cells,)."""
        return np.array([cell.scatter for cell in self.cells], np.float64)

    @cached_property
    def lasting(self) -> FloatArray:
        """Part of the scatter of each cell that averaging does not reduce (n_cells,)."""
        return np.array([cell.lasting for cell in self.cells], np.float64)

    @cached_property
    def passing(self) -> FloatArray:
        """Part of the scatter of each cell that averaging reduces (n_cells,)."""
        return np.asarray(np.sqrt(self.scatter**2 - self.lasting**2))

    @cached_property
    def node_std(self) -> FloatArray:
        """Surface uncertainty (NODES, NODES, n_cells), by eccentricity, temperature and cell."""
        rows = np.array([cell.node_std for cell in self.cells], np.float64)
        return rows.reshape(-1, NODES, NODES).transpose(1, 2, 0)

    @cached_property
    def middle(self) -> FilmConditions:
        """Median condition of each cell (n_cells,)."""
        rows = [(c.eccentricity_ratio, c.oil_temperature_c, c.attitude_deg) for c in self.cells]
        return FilmConditions(*np.array(rows, np.float64).reshape(-1, 3).T)

    @cached_property
    def _rows(self) -> dict[Cell, int]:
        """Table row of each supported cell."""
        rows = enumerate(self.cells)
        return {cell.cell: row for row, cell in rows if cell.support is not Support.NONE}


def cells_between(own: frozenset[Cell], reach: int) -> frozenset[Cell]:
    """Return the cells that lie between two cells of `own` along an axis.

    `own` contains the cells with enough own readings. Cells between two of them are included if
    they are at most `reach` in number.
    """
    found: set[Cell] = set()
    for cell in own:
        for axis in range(len(cell)):
            before, at, after = cell[:axis], cell[axis], cell[axis + 1 :]
            line = [(*before, at + step, *after) for step in range(1, reach + 2)]
            ends = [place for place, other in enumerate(line) if other in own]
            if ends:
                found.update(line[: ends[0]])
    return frozenset(found)


def neighbourhood(cell: Cell) -> tuple[Cell, ...]:
    """Return a cell and all cells that touch it, including diagonal neighbours."""
    steps = itertools.product((-1, 0, 1), repeat=len(cell))
    return tuple(tuple(i + step for i, step in zip(cell, by, strict=True)) for by in steps)
