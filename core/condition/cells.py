"""Film conditions, which the stiffness depends on, and their division into condition cells."""

import math
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import BoolArray, FloatArray, IntArray
from core.condition.operating_state import OperatingState


@dataclass(frozen=True, eq=False)
class FilmConditions:
    """Conditions that film stiffness depends on, for n readings as columns (n,); NaN if unknown."""

    eccentricity_ratio: FloatArray
    oil_temperature_c: FloatArray
    attitude_deg: FloatArray

    @classmethod
    def one(cls, eccentricity_ratio: float, oil_temperature_c: float, attitude_deg: float) -> Self:
        """Return the conditions of a single reading, n = 1."""
        columns = np.array([[eccentricity_ratio], [oil_temperature_c], [attitude_deg]])
        return cls(*columns)

    def __len__(self) -> int:
        return int(self.eccentricity_ratio.size)

    def rows(self, wanted: npt.NDArray[np.bool_ | np.int64]) -> "FilmConditions":
        """Return the conditions of the readings selected by a mask (n,) or by indices."""
        return FilmConditions(*(column[wanted] for column in vars(self).values()))

    def is_known(self, needs_attitude: bool) -> BoolArray:
        """Return whether eccentricity, oil temperature and, if needed, attitude are finite (n,)."""
        known = np.isfinite(self.eccentricity_ratio) & np.isfinite(self.oil_temperature_c)
        return known & np.isfinite(self.attitude_deg) if needs_attitude else known


Cell: TypeAlias = tuple[int, ...]
"""Bin numbers of eccentricity ratio, oil temperature and, if in the grid, attitude angle."""

CellArray: TypeAlias = IntArray
"""Cells of n readings as bin numbers (n_axes, n), in the order of the axes in `Cell`."""


@dataclass(frozen=True)
class CellGrid:
    """Grid of condition cells, given by bin widths; bin 0 of each axis begins at zero.

    Without an attitude width, the cells do not depend on the attitude angle.

    Raises ValueError if a width is not a positive number, or the attitude width does not divide
    360°. The message states key and value.
    """

    eccentricity_width: float = 0.05
    temperature_width_c: float = 2.5
    attitude_width_deg: float | None = None

    def __post_init__(self) -> None:
        for key in ("eccentricity_width", "temperature_width_c", "attitude_width_deg"):
            value = getattr(self, key)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{key} = {value:g} must be a number above 0")
        turn = 360.0 / (self.attitude_width_deg or 360.0)
        if abs(turn - round(turn)) > 1e-9:
            raise ValueError(f"attitude_width_deg = {self.attitude_width_deg:g} must divide 360°")

    @property
    def has_attitude(self) -> bool:
        """Whether cells depend on the attitude angle."""
        return self.attitude_width_deg is not None

    def cells(self, conditions: FilmConditions) -> CellArray:
        """Return the cells of n readings (n_axes, n); valid only where `is_known` is true."""
        axes = [
            conditions.eccentricity_ratio / self.eccentricity_width,
            conditions.oil_temperature_c / self.temperature_width_c,
        ]
        if self.attitude_width_deg is not None:
            axes.append(np.mod(conditions.attitude_deg, 360.0) / self.attitude_width_deg)
        return np.floor(np.nan_to_num(np.stack(axes))).astype(np.int64)

    def is_known(self, conditions: FilmConditions) -> BoolArray:
        """Return whether all conditions that the cell depends on are known (n,)."""
        return conditions.is_known(self.has_attitude)

    def centre(self, cell: Cell) -> tuple[float, ...]:
        """Return eccentricity ratio, oil temperature and, if used, attitude at a cell's centre."""
        widths = (self.eccentricity_width, self.temperature_width_c, self.attitude_width_deg)
        return tuple((i + 0.5) * w for i, w in zip(cell, widths, strict=False) if w is not None)


@dataclass(frozen=True)
class OperatingPoint:
    """Operating state of a unit and film condition of a bearing; None for unknown values."""

    state: OperatingState = OperatingState.UNKNOWN
    eccentricity_ratio: float | None = None
    attitude_deg: float | None = None
    oil_temperature_c: float | None = None


NOWHERE_KNOWN = OperatingPoint()


@dataclass(frozen=True)
class BearingCondition:
    """Condition of a bearing: operating state, whether it has settled, cell (None if unknown).

    A state has settled when it has lasted for the settling time after the warm-up. Only then is
    film stiffness compared with its baseline.
    """

    state: OperatingState
    is_settled: bool
    cell: Cell | None
