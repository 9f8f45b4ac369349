"""Readings of one bearing over time as columns: what baselines learn from and back-tests run on."""

from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.condition.cells import FilmConditions

CodeArray: TypeAlias = npt.NDArray[np.int8]
"""Members of an IntEnum, one byte each."""

DIRECTIONS = ("x", "y")
"""Rows of every column of shape (2, n)."""


class ReadingOutcome(IntEnum):
    """Whether a stiffness was measured, and if not, why there is no number."""

    MEASURED = 0
    INSUFFICIENT_EXCITATION = 1
    BAD_QUALITY = 2


@dataclass(frozen=True, eq=False)
class StiffnessHistory:
    """One bearing of one unit; readings in order of time, NaN where there is no number.

    Columns are (n,); those by direction, `PER_DIRECTION`, are (2, n). Hours without a reading are
    allowed and are gaps.

    Parameters
    ----------
    ln_k
        Natural logarithm of measured stiffness in N/m.
    u_random
        Random standard uncertainty of stiffness relative to it, which is that of `ln_k`.
    shaft_um_pk, bearing_um_pk
        Amplitudes at 1×, of shaft relative to bearing and of bearing.
    outcome
        Members of `ReadingOutcome`; by default a missing `ln_k` is of bad quality.

    Raises
    ------
    ValueError
        With column and row, if a column has another shape, time does not increase, a number is
        infinite, an uncertainty is not above zero, or outcome and number contradict one another.
    """

    time_ns: TimeArray
    speed_rpm: FloatArray
    power_mw: FloatArray
    eccentricity_ratio: FloatArray
    u_eccentricity: FloatArray
    attitude_deg: FloatArray
    oil_temperature_c: FloatArray
    ln_k: FloatArray
    u_random: FloatArray
    shaft_um_pk: FloatArray
    bearing_um_pk: FloatArray
    outcome: CodeArray = field(default_factory=lambda: np.empty((2, 0), np.int8))

    def __post_init__(self) -> None:
        if self.outcome.size == 0:
            missing = np.where(
                np.isnan(self.ln_k), ReadingOutcome.BAD_QUALITY, ReadingOutcome.MEASURED
            )
            object.__setattr__(self, "outcome", missing.astype(np.int8))
        self._check_shapes()
        steps = np.flatnonzero(np.diff(self.time_ns) <= 0)
        if steps.size:
            raise ValueError(f"time_ns: row {steps[0] + 1} is not after row {steps[0]}")
        self._check_numbers()

    def __len__(self) -> int:
        return int(self.time_ns.size)

    @property
    def conditions(self) -> FilmConditions:
        """Conditions of all readings."""
        return FilmConditions(self.eccentricity_ratio, self.oil_temperature_c, self.attitude_deg)

    def rows(self, start: int, stop: int) -> "StiffnessHistory":
        """The readings from row `start` up to, not including, row `stop`."""
        return self.where(slice(start, stop))

    def where(self, wanted: npt.NDArray[np.bool_] | slice) -> "StiffnessHistory":
        """The readings that a mask of shape (n,) or a slice picks."""
        return StiffnessHistory(
            **{f.name: getattr(self, f.name)[..., wanted] for f in fields(self)}
        )

    def _check_shapes(self) -> None:
        for column in fields(self):
            shape = getattr(self, column.name).shape
            wanted = (2, len(self)) if column.name in PER_DIRECTION else (len(self),)
            if shape != wanted:
                raise ValueError(f"{column.name}: shape {shape}, expected {wanted}")

    def _check_numbers(self) -> None:
        for column in fields(self):
            _refuse(column.name, "is infinite", np.isinf(getattr(self, column.name)))
        measured = np.isfinite(self.ln_k)
        _refuse(
            "outcome", "contradicts ln_k", (self.outcome == ReadingOutcome.MEASURED) != measured
        )
        _refuse("u_random", "must be above 0", measured & ~(self.u_random > 0.0))


PER_DIRECTION = frozenset({"ln_k", "u_random", "shaft_um_pk", "bearing_um_pk", "outcome"})
"""Columns of shape (2, n)."""


def _refuse(column: str, why: str, is_wrong: npt.NDArray[np.bool_]) -> None:
    wrong = np.argwhere(is_wrong)
    if wrong.size:
        raise ValueError(f"{column}: row {wrong[0][-1]} {why}")
