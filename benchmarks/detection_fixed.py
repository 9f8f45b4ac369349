"""What monitoring without conditions does: one band around the usual stiffness, come what may."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.grouping import running_median

N_ON, N_OFF = 6, 48
"""An hour and eight, as for the sequential test."""

HELD_SHARE = 0.8
BANDS = np.round(np.arange(0.1, 3.01, 0.05), 2)
"""Half-widths of the band that are tried, in ln."""


@dataclass(frozen=True)
class FixedThreshold:
    """Median of ln k over the learning period; alarms where a reading leaves the band about it."""

    middle: float

    @classmethod
    def learned(cls, ln_k: FloatArray) -> "FixedThreshold":
        return cls(float(np.nanmedian(ln_k)))

    def levels(
        self, ln_k: FloatArray, is_settled: npt.NDArray[np.bool_], band: float
    ) -> npt.NDArray[np.bool_]:
        """(n,) whether it alarms after each reading."""
        rows = np.flatnonzero(is_settled & np.isfinite(ln_k))
        if rows.size == 0:
            return np.zeros(ln_k.size, np.bool_)
        size = np.abs(running_median(ln_k[rows]) - self.middle)
        level = _levels(size > band, size > HELD_SHARE * band)
        latest = np.searchsorted(rows, np.arange(ln_k.size), side="right") - 1
        return np.where(latest >= 0, level[latest], False)

    def raised(
        self, ln_k: FloatArray, is_settled: npt.NDArray[np.bool_], band: float
    ) -> npt.NDArray[np.int64]:
        """Rows in which an alarm begins."""
        level = self.levels(ln_k, is_settled, band)
        return np.flatnonzero(np.diff(level.astype(np.int8), prepend=np.int8(0)) > 0)


def _levels(
    is_passed: npt.NDArray[np.bool_], is_held: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """(n,) whether a level is active after each reading."""
    switched_on = _in_a_row(is_passed) >= N_ON
    switched_off = (_in_a_row(~is_held) >= N_OFF) & ~switched_on
    return _last_row(switched_on) > _last_row(switched_off)


def _last_row(happens: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """(n,) row in which something happened last; -1 if it has not."""
    rows = np.where(happens, np.arange(happens.size), -1)
    return np.maximum.accumulate(rows) if rows.size else rows


def _in_a_row(happens: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """(n,) for how many readings it has happened without interruption."""
    return np.arange(happens.size) - _last_row(~happens)
