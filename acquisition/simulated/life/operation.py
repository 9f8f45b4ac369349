"""What a unit is run at, on an even grid of times."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.units import NS_PER_S

RATED_POWER_MW = 700.0
STEP_S = 600.0


@dataclass(frozen=True, eq=False)
class Operation:
    """Speed and power at evenly spaced times; all (n,).

    Parameters
    ----------
    time_ns
        The step divides time constants, and is that of the readings.
    """

    time_ns: TimeArray
    speed_rpm: FloatArray
    power_mw: FloatArray
    rated_speed_rpm: float
    rated_power_mw: float = RATED_POWER_MW

    def __len__(self) -> int:
        return int(self.time_ns.size)

    @property
    def step_s(self) -> float:
        """Time from one row to the next."""
        return float(self.time_ns[1] - self.time_ns[0]) / NS_PER_S

    @property
    def load(self) -> FloatArray:
        """(n,) power over rated power."""
        return self.power_mw / self.rated_power_mw

    @property
    def is_turning(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the shaft turns at all."""
        return self.speed_rpm > 0.0

    @property
    def is_at_speed(self) -> npt.NDArray[np.bool_]:
        """(n,) whether it has its rated speed, not counting run-ups."""
        return self.speed_rpm > 0.95 * self.rated_speed_rpm

    @property
    def starts(self) -> npt.NDArray[np.int64]:
        """First row of every stretch of turning."""
        return np.flatnonzero(np.diff(self.is_turning.astype(np.int8), prepend=np.int8(0)) == 1)


def time_grid_ns(start_ns: int, years: float, step_s: float = STEP_S) -> TimeArray:
    """Times of the readings of some years of 365.25 days.

    Raises
    ------
    ValueError
        If there would be less than a day.
    """
    n = int(years * 365.25 * 86_400.0 / step_s)
    if not n * step_s >= 86_400.0:
        raise ValueError(f"a life needs at least a day, got {years} years")
    return start_ns + np.arange(n, dtype=np.int64) * np.int64(step_s * NS_PER_S)
