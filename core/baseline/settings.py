"""Settings for learning a baseline."""

from dataclasses import dataclass, field

from core.arrays import BoolArray
from core.condition.cells import CellGrid, FilmConditions


@dataclass(frozen=True)
class BaselineSettings:
    """Settings for learning a baseline: data requirements and smoothness of the surface.

    Parameters
    ----------
    uses_attitude
        Whether the surface depends on the attitude angle, because pads are set unevenly and x and
        y differ. `grid` defines whether the cells depend on the attitude angle.
    min_readings
        Number of readings that a cell needs for own support.
    min_days
        Number of days with readings that a cell needs for own support.
    borrowing_readings
        Number of readings with which a cell borrows support, if the cell and its neighbours have
        at least `min_days` in total.
    borrowing_reach
        Largest number of cells between two cells of own support that borrow support from both.
    max_surface_std
        Standard uncertainty of the surface, in ln, above which a cell has no support.
    min_learning_days
        Number of days with readings required for a baseline.
    knot_cells
        Knot spacing of the surface, in cells.
    bend_std
        Prior standard deviation of the change of slope of ln k between knots.
    time_scales_h
        Averaging times of deviations in running hours, shortest first. Large losses of stiffness
        are detected on short time scales, small losses on long ones.
    reading_h
        Interval between readings in running hours.
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
        """Whether the surface or the cells depend on the attitude angle."""
        return self.uses_attitude or self.grid.has_attitude

    def is_known(self, conditions: FilmConditions) -> BoolArray:
        """Return whether all conditions that the baseline depends on are known (n,)."""
        return conditions.is_known(self.has_attitude)
