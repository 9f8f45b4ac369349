"""Smooth surface of ln stiffness over eccentricity ratio and oil temperature: cubic B-splines."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from core.arrays import FloatArray, IntArray
from core.condition.cells import FilmConditions

ATTITUDE_TERMS = 4
"""Number of attitude terms: first and second harmonic of the angle, for an out-of-round bearing."""


@dataclass(frozen=True)
class KnotAxis:
    """Uniform spline knots on an axis: `n_intervals` intervals of equal `width` from `start`.

    Raises `ValueError` if the width is not above 0, or there is no interval.
    """

    start: float
    width: float
    n_intervals: int

    def __post_init__(self) -> None:
        if not (self.width > 0.0 and self.n_intervals >= 1):
            found = f"{self.width:g} and {self.n_intervals}"
            raise ValueError(f"width must be above 0 and n_intervals at least 1, got {found}")

    @property
    def n_splines(self) -> int:
        """Number of cubic B-splines that are non-zero on the axis."""
        return self.n_intervals + 3

    def splines(self, x: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the non-zero splines at each x (n,).

        Beyond the ends, the outermost cubic polynomials are extrapolated.

        Returns
        -------
        Index of the first of the four non-zero splines (n,), and their values (4, n).
        """
        along = (x - self.start) / self.width
        first = np.clip(np.floor(along), 0, self.n_intervals - 1).astype(np.int64)
        u = along - first
        # uniform cubic B-spline (de Boor, A Practical Guide to Splines, IX)
        values = np.stack(
            [
                (1.0 - u) ** 3,
                3.0 * u**3 - 6.0 * u**2 + 4.0,
                -3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0,
                u**3,
            ]
        )
        return first, values / 6.0


@dataclass(frozen=True)
class SurfaceShape:
    """Shape of a surface: knots on both axes, and whether it depends on the attitude angle."""

    eccentricity: KnotAxis
    temperature: KnotAxis
    has_attitude: bool = False

    @property
    def n_coefficients(self) -> int:
        """Number of coefficients: one per tensor product of splines and per attitude term."""
        tensor = self.eccentricity.n_splines * self.temperature.n_splines
        return tensor + (ATTITUDE_TERMS if self.has_attitude else 0)

    def terms(self, conditions: FilmConditions) -> tuple[IntArray, FloatArray]:
        """Return indices and values (16, n) of the non-zero products of splines at n conditions."""
        first_e, value_e = self.eccentricity.splines(conditions.eccentricity_ratio)
        first_t, value_t = self.temperature.splines(conditions.oil_temperature_c)
        step = np.arange(4)[:, np.newaxis]
        rows = (first_e + step) * self.temperature.n_splines
        index = rows[:, np.newaxis] + (first_t + step)[np.newaxis]
        value = value_e[:, np.newaxis] * value_t[np.newaxis]
        shape = (16, len(conditions))
        return index.reshape(shape), value.reshape(shape)

    def design(self, conditions: FilmConditions) -> FloatArray:
        """Return the design matrix (n, n_coefficients) of a fit to readings at n conditions."""
        index, value = self.terms(conditions)
        matrix = np.zeros((len(conditions), self.n_coefficients))
        np.put_along_axis(matrix, index.T, value.T, axis=1)
        if self.has_attitude:
            matrix[:, -ATTITUDE_TERMS:] = attitude_terms(conditions).T
        return matrix


def attitude_terms(conditions: FilmConditions) -> FloatArray:
    """Return e cos α, e sin α, e² cos 2α and e² sin 2α (4, n), with attitude α, eccentricity e."""
    angle = np.radians(conditions.attitude_deg)
    once, twice = conditions.eccentricity_ratio, conditions.eccentricity_ratio**2
    return np.stack(
        [
            once * np.cos(angle),
            once * np.sin(angle),
            twice * np.cos(2.0 * angle),
            twice * np.sin(2.0 * angle),
        ]
    )


@dataclass(frozen=True)
class Surface:
    """Fitted surface of ln stiffness: shape, constant offset, spline and attitude coefficients.

    Raises `ValueError` if the number of coefficients does not fit the shape.
    """

    shape: SurfaceShape
    offset: float
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.coefficients) != self.shape.n_coefficients:
            raise ValueError(
                f"a surface of this shape has {self.shape.n_coefficients} coefficients, got"
                f" {len(self.coefficients)}"
            )

    @cached_property
    def _coefficients(self) -> FloatArray:
        return np.array(self.coefficients)

    def slope(self, conditions: FilmConditions) -> FloatArray:
        """Return d ln(stiffness) / d(eccentricity ratio) (n,) from steps of ± 1/4 knot width."""
        step = self.shape.eccentricity.width / 4.0
        up, down = (
            self.at(replace(conditions, eccentricity_ratio=conditions.eccentricity_ratio + by))
            for by in (step, -step)
        )
        return np.asarray((up - down) / (2.0 * step))

    def at(self, conditions: FilmConditions) -> FloatArray:
        """Return the value of the surface, ln of the stiffness, at n conditions (n,)."""
        index, value = self.shape.terms(conditions)
        height = np.zeros(len(conditions))
        for row in range(index.shape[0]):  # summation order does not depend on n
            height += self._coefficients[index[row]] * value[row]
        if self.shape.has_attitude:
            height += self._coefficients[-ATTITUDE_TERMS:] @ attitude_terms(conditions)
        return np.asarray(self.offset + height)
