"""The conditions that films are compared under: eccentricity, oil temperature, attitude."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class FilmConditions:
    """Conditions of n readings as columns; NaN where something is not known.

    Parameters
    ----------
    eccentricity_ratio, oil_temperature_c, attitude_deg : (n,)
    """

    eccentricity_ratio: FloatArray
    oil_temperature_c: FloatArray
    attitude_deg: FloatArray

    @classmethod
    def one(cls, eccentricity_ratio: float, oil_temperature_c: float, attitude_deg: float) -> Self:
        """Condition of one reading."""
        columns = np.array([[eccentricity_ratio], [oil_temperature_c], [attitude_deg]])
        return cls(*columns)

    def __len__(self) -> int:
        return int(self.eccentricity_ratio.size)

    def rows(self, wanted: npt.NDArray[np.bool_ | np.int64]) -> "FilmConditions":
        """Some of the readings, by mask or row."""
        return FilmConditions(
            self.eccentricity_ratio[wanted],
            self.oil_temperature_c[wanted],
            self.attitude_deg[wanted],
        )
