"""How a baseline is learned."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from core.condition.cells import CellGrid, FilmConditions


@dataclass(frozen=True)
class BaselineSettings:
    """Requirements of a baseline, and smoothness of its surface.

    Parameters
    ----------
    grid
        Cells of eccentricity and oil temperature.
    uses_attitude
        Whether the surface depends on the attitude angle too: pads are not set evenly, and x is not
        y. The grid decides whether cells do.
    min_readings, min_days
        Readings, and days with readings, that give a cell support of its own.
    borrowing_readings
        Readings that let a cell borrow support, if it and its neighbours have `min_days` in all.
    borrowing_reach
        Largest number of cells between two of own support that borrow from these through the
        surface.
    max_surface_std
        Uncertainty of the surface, in ln, above which a cell is not supported after all.
    min_learning_days
        Days with readings before there is a baseline at all.
    knot_cells
        Cells from one knot of the surface to the next.
    bend_std
        Prior standard deviation of the change of slope of ln k from knot to knot.
    time_scales_h
        Running hours over which deviations are averaged, shortest first: large losses show on the
        short time scales, small ones on the long ones.
    reading_h
        Running hours from one reading to the next.
    """

    grid: CellGrid = field(default_factory=CellGrid)
    uses_attitude: bool = True
    min_readings: int = 20
    min_days: int = 3
    borrowing_readings: int = 6
    borrowing_reach: int = 2
    max_surface_std: float = 0.05
    min_learning_days: int = 20
    knot_cells: float = 2.0
    bend_std: float = 0.1
    time_scales_h: tuple[float, ...] = (4.0, 16.0, 64.0, 128.0)
    reading_h: float = 1.0 / 6.0

    @property
    def has_attitude(self) -> bool:
        """Whether surface or cells depend on the attitude angle."""
        return self.uses_attitude or self.grid.has_attitude

    def is_known(self, conditions: FilmConditions) -> npt.NDArray[np.bool_]:
        """(n,) whether readings have everything that the baseline depends on."""
        return conditions.is_known(self.has_attitude)
