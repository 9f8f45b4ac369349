"""`StiffnessHistory`: stiffness readings of one bearing over time."""

import math
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import BoolArray, ComplexArray, FloatArray, TimeArray
from core.condition.cells import FilmConditions

CodeArray: TypeAlias = npt.NDArray[np.int8]
"""Values of an IntEnum as int8."""

DIRECTIONS = ("x", "y")
"""Directions of the film stiffness; row 0 of a (2, n) column is x, row 1 is y."""


@dataclass(frozen=True)
class FilmQuantity:
    """Quantity of a film in one direction that is learned and judged.

    `value` and `uncertainty` name the columns of `StiffnessHistory` that contain the natural
    logarithm of the quantity and its random standard uncertainty.
    """

    direction: str
    value: str
    uncertainty: str

    @property
    def label(self) -> str:
        """Displayed name of the quantity: its direction, and "c/k" for damping over stiffness."""
        return self.direction if self.value == "ln_k" else f"c/k {self.direction}"

    @property
    def row(self) -> int:
        """Row of the direction in (2, n) columns."""
        return DIRECTIONS.index(self.direction)


QUANTITIES = {
    f"{name}_{d}": FilmQuantity(d, value, uncertainty)
    for name, value, uncertainty in (("k", "ln_k", "u_random"), ("ck", "ln_ck", "u_ck"))
    for d in DIRECTIONS
}
"""Watched quantities by name: stiffness k, and damping over stiffness c/k; in x and in y.

Rows of (4, n) columns are in this order."""


MIN_LN_K = math.log(1e5)
"""Smallest ln of a stiffness in N/m; larger than that of any ratio to a bracket stiffness. Brackets
have 1e7 N/m and more, and films are less than a hundred times softer or stiffer."""


def are_ratios(ln_k: FloatArray | float) -> BoolArray:
    """Return whether each value of ln k is of a ratio to the bracket stiffness, not of N/m."""
    return np.asarray(np.asarray(ln_k) < MIN_LN_K)


def absolute_and_ratio(values: FloatArray, ln_k: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values of stiffness in N/m, and values of ratios to k_b, by `ln_k`; NaN elsewhere."""
    are = are_ratios(ln_k)
    return np.where(are, np.nan, values), np.where(are, values, np.nan)


class ReadingOutcome(IntEnum):
    """Outcome of a stiffness measurement: measured, or the reason why the value is missing."""

    MEASURED = 0
    INSUFFICIENT_EXCITATION = 1
    BAD_QUALITY = 2


@dataclass(frozen=True, eq=False)
class StiffnessHistory:
    """Stiffness readings of one bearing in order of time, as columns; NaN for missing values.

    Columns are (n,), or (2, n) with directions x and y on axis 0. Time may have gaps.

    Parameters
    ----------
    ln_k
        Natural logarithm of the measured stiffness in N/m, or of its ratio to an unknown bracket
        stiffness; see `are_ratios`.
    u_random
        Relative random standard uncertainty of the stiffness, equal to that of `ln_k`.
    u_eccentricity
        Standard uncertainty of the eccentricity ratio.
    shaft_um_pk, bearing_um_pk
        1× amplitudes of the shaft relative to the bearing, and of the bearing itself.
    outcome
        Values of `ReadingOutcome`; by default, a missing `ln_k` is `BAD_QUALITY`.
    ln_ck, u_ck
        Natural logarithm of damping over stiffness in s, and its random standard uncertainty; NaN
        by default.
    shaft_phase_deg, bearing_phase_deg
        Phases of the 1× motion of shaft and bearing; NaN by default.

    Raises
    ------
    ValueError
        If a column has a wrong shape, time does not increase, a value is infinite, `u_random` of a
        measured value is not positive, or `outcome` contradicts `ln_k`.
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
    ln_ck: FloatArray = field(default_factory=lambda: np.empty((2, 0)))
    u_ck: FloatArray = field(default_factory=lambda: np.empty((2, 0)))
    shaft_phase_deg: FloatArray = field(default_factory=lambda: np.empty((2, 0)))
    bearing_phase_deg: FloatArray = field(default_factory=lambda: np.empty((2, 0)))

    def __post_init__(self) -> None:
        if self.outcome.size == 0:
            missing = np.where(
                np.isnan(self.ln_k), ReadingOutcome.BAD_QUALITY, ReadingOutcome.MEASURED
            )
            object.__setattr__(self, "outcome", missing.astype(np.int8))
        for name in MAY_BE_MISSING:
            if getattr(self, name).size == 0:
                object.__setattr__(self, name, np.full(self.ln_k.shape, np.nan))
        self._check_shapes()
        steps = np.flatnonzero(np.diff(self.time_ns) <= 0)
        if steps.size:
            raise ValueError(f"time_ns: row {steps[0] + 1} must be later than row {steps[0]}")
        self._check_numbers()

    def __len__(self) -> int:
        return int(self.time_ns.size)

    @property
    def conditions(self) -> FilmConditions:
        """Film conditions of all readings."""
        return FilmConditions(self.eccentricity_ratio, self.oil_temperature_c, self.attitude_deg)

    @property
    def motion_um(self) -> ComplexArray:
        """1× phasors of shaft and bearing in µm, (2, 2, n) by part and direction."""
        amplitude = np.stack([self.shaft_um_pk, self.bearing_um_pk])
        phase = np.radians(np.stack([self.shaft_phase_deg, self.bearing_phase_deg]))
        return np.asarray(amplitude * np.exp(1j * phase))

    def of(self, name: str) -> tuple[FloatArray, FloatArray, CodeArray]:
        """Return ln and random uncertainty of one of the `QUANTITIES`, and `outcome`, (n,) each."""
        quantity = QUANTITIES[name]
        columns = (quantity.value, quantity.uncertainty, "outcome")
        value, u_random, outcome = (getattr(self, column)[quantity.row] for column in columns)
        return value, u_random, outcome

    def rows(self, start: int, stop: int) -> "StiffnessHistory":
        """Return the readings with the indices `start` to `stop - 1`."""
        return self.where(slice(start, stop))

    def where(self, wanted: BoolArray | slice) -> "StiffnessHistory":
        """Return the readings selected by a mask (n,) or a slice."""
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
        measured, has_ck = np.isfinite(self.ln_k), np.isfinite(self.ln_ck)
        _refuse(
            "outcome", "contradicts ln_k", (self.outcome == ReadingOutcome.MEASURED) != measured
        )
        _refuse("u_random", "must be above 0", measured & ~(self.u_random > 0.0))
        _refuse("u_ck", "must be above 0", has_ck & ~(self.u_ck > 0.0))


MAY_BE_MISSING = ("ln_ck", "u_ck", "shaft_phase_deg", "bearing_phase_deg")
PER_DIRECTION = frozenset(
    {"ln_k", "u_random", "shaft_um_pk", "bearing_um_pk", "outcome", *MAY_BE_MISSING}
)
"""Names of the columns of shape (2, n), with rows for x and y."""


def _refuse(column: str, why: str, is_wrong: BoolArray) -> None:
    wrong = np.argwhere(is_wrong)
    if wrong.size:
        raise ValueError(f"{column}: row {wrong[0][-1]} {why}")
