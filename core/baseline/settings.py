"""How a baseline is learned."""

import math
from dataclasses import dataclass, field

from core.condition.cells import CellGrid


@dataclass(frozen=True)
class BaselineSettings:
    """What a baseline needs, and how stiff its surface is.

    Parameters
    ----------
    grid
        Cells of eccentricity and oil temperature.
    min_readings, min_days
        Readings, and days with readings, below which a cell knows nothing by itself.
    borrowing_readings
        Readings from which on a cell that lies between two of its own support may borrow from its
        neighbours through the surface.
    max_surface_std
        Uncertainty of the surface, in ln, above which a cell is not supported after all.
    min_learning_days
        Days with readings before there is a baseline at all.
    knot_cells
        Cells from one knot of the surface to the next.
    bend_std
        How much the slope of ln k is expected to change from knot to knot (prior standard
        deviation).
    time_scales_h
        Running hours over which deviations are averaged, shortest first: a large loss is found on
        the short ones, a small one on the long ones.
    reading_h
        Running hours that one reading stands for: how often readings are taken in.

    Raises
    ------
    ValueError
        With key and value, if one is not a number above zero, or time scales do not increase.
    """

    grid: CellGrid = field(default_factory=CellGrid)
    min_readings: int = 30
    min_days: int = 5
    borrowing_readings: int = 6
    max_surface_std: float = 0.05
    min_learning_days: int = 20
    knot_cells: float = 2.0
    bend_std: float = 0.1
    time_scales_h: tuple[float, ...] = (4.0, 16.0, 64.0, 192.0)
    reading_h: float = 1.0 / 6.0

    def __post_init__(self) -> None:
        for key in POSITIVE:
            value = getattr(self, key)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{key} = {value:g} must be a number above 0")
        scales_h = self.time_scales_h
        if not all(math.isfinite(h) and h > self.reading_h for h in scales_h) or not scales_h:
            raise ValueError(f"time_scales_h = {scales_h} must be numbers above {self.reading_h:g}")
        if list(scales_h) != sorted(set(scales_h)):
            raise ValueError(f"time_scales_h = {scales_h} must increase")


POSITIVE = (
    *("min_readings", "min_days", "borrowing_readings", "max_surface_std", "min_learning_days"),
    *("knot_cells", "bend_std", "reading_h"),
)
