"""Robust fit of a baseline surface, with larger scatter where the surface is steep."""

from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray, IntArray
from core.baseline.grouping import Groups, bisquare, robust_std
from core.baseline.settings import BaselineSettings
from core.baseline.surface import ATTITUDE_TERMS, KnotAxis, Surface, SurfaceShape
from core.condition.cells import FilmConditions

MAX_STDS = 3.0
"""Number of standard deviations at which deviations are clipped in the fit of the scatter."""

FLAT_SHARE = 0.25
"""Fraction of the deviations, those at the smallest slopes, to which the slope adds no scatter."""

ROUNDS = 8
MIN_SCATTER = 1e-6


@dataclass(frozen=True)
class SlopeScatter:
    """Model of the variance of a deviation as a function of the slope of the surface.

    The variance is `flat` up to the squared slope `flat_square`. Above, it increases linearly with
    the squared slope, with the factor `per_slope`.
    """

    flat: float
    per_slope: float
    flat_square: float

    def lasting(self, slope: FloatArray) -> FloatArray:
        """Return the part of the variance due to shaft position errors at each slope (n,)."""
        return self.per_slope * np.maximum(slope**2 - self.flat_square, 0.0)

    def variance(self, slope: FloatArray) -> FloatArray:
        """Return the variance of a deviation at each slope (n,)."""
        return np.asarray(self.flat + self.lasting(slope))


def slope_scatter(slope: FloatArray, deviation: FloatArray) -> SlopeScatter:
    """Return the variance model fitted to the squares of deviations (n,) at slopes (n,)."""
    from scipy.optimize import nnls  # slow import, not needed at start-up

    flat_square = float(np.quantile(slope**2, FLAT_SHARE))
    steep = np.maximum(slope**2 - flat_square, 0.0)
    terms = np.stack([np.ones(slope.size), steep], axis=1)
    expected = np.full(slope.size, max(robust_std(deviation), MIN_SCATTER) ** 2)
    flat, per_slope = MIN_SCATTER**2, 0.0
    for _ in range(ROUNDS):
        square = np.minimum(deviation**2, MAX_STDS**2 * expected)
        (flat, per_slope), _ = nnls(terms / expected[:, np.newaxis], square / expected)
        expected = np.maximum(terms @ (flat, per_slope), MIN_SCATTER**2)
    return SlopeScatter(max(float(flat), MIN_SCATTER**2), float(per_slope), flat_square)


HUBER_LIMIT = 1.345
HUBER_ROUNDS, BISQUARE_ROUNDS, SLOPE_ROUNDS = 6, 8, 4

SLOPE_STD = 2.0
"""Prior standard deviation of the change of ln k between knots. It is wide, and matters only where
all readings lie on a line."""

ATTITUDE_STD = 1.0
MIN_STD = 1e-4
"""Smallest scatter of groups, in ln."""

FEW_READINGS = 2.0
"""Number of readings at which a group has half the weight of a very large group."""

SPANS_DAYS = (1, 10)
"""Lengths in days of the time blocks over which residuals are tested for correlation."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted surface with its uncertainty.

    Parameters
    ----------
    covariance : (n_coefficients, n_coefficients)
        Covariance of the coefficients.
    robust_weight : (n_groups,)
        Robust weight of each group: 1 for a good fit, 0 for a rejected group.
    group_std : (n_groups,)
        Standard deviation of each group about the surface.
    clustering
        Number of correlated groups that are worth one independent group; at least 1.
    """

    surface: Surface
    covariance: FloatArray
    robust_weight: FloatArray
    group_std: FloatArray
    clustering: float

    @property
    def attitude_covariance(self) -> tuple[tuple[float, ...], ...]:
        """Covariance of the attitude terms; empty without attitude terms."""
        if not self.surface.shape.has_attitude:
            return ()
        part = self.covariance[-ATTITUDE_TERMS:, -ATTITUDE_TERMS:]
        return tuple(tuple(row) for row in part.tolist())

    def std(self, conditions: FilmConditions) -> FloatArray:
        """Return the standard uncertainty of the surface at n conditions (n,)."""
        design = self.surface.shape.design(conditions)
        variance = np.einsum("ij,jk,ik->i", design, self.covariance, design)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def fit_surface(groups: Groups, settings: BaselineSettings) -> Fit:
    """Return a surface fitted robustly to groups; `settings` give its knots and smoothness."""
    from scipy.linalg import cho_solve  # slow import, not needed at start-up

    shape, offset = _surface_shape(groups, settings), float(np.median(groups.value))
    points = _Points.of(groups, shape, offset)
    prior = _prior_precision(shape, settings.bend_std)
    coefficients, robust = _resisting(points, prior)
    for _ in range(SLOPE_ROUNDS):
        slope = Surface(shape, offset, tuple(coefficients.tolist())).slope(groups.conditions)
        std = _std(points, coefficients, robust, slope)
        robust = bisquare(points.left(coefficients) / std)
        coefficients, _ = points.solve(robust / std**2, prior)
    clustering = _clustering(points, coefficients, robust, std)
    coefficients, factor = points.solve(robust / (std**2 * clustering), prior)
    covariance = cho_solve((factor, True), np.eye(prior.shape[0]))
    surface = Surface(shape, offset, tuple(coefficients.tolist()))
    return Fit(surface, covariance, robust, std, clustering)


@dataclass(frozen=True, eq=False)
class _Points:
    """Regression rows, one per group; `trust` is the weight from the number of readings."""

    design: FloatArray
    y: FloatArray
    trust: FloatArray
    day: IntArray

    @classmethod
    def of(cls, groups: Groups, shape: SurfaceShape, offset: float) -> "_Points":
        trust = groups.n_readings / (groups.n_readings + FEW_READINGS)
        return cls(shape.design(groups.conditions), groups.value - offset, trust, groups.day)

    def left(self, coefficients: FloatArray) -> FloatArray:
        """Return the residuals (n,), scaled so that all groups have equal scatter."""
        return np.asarray((self.y - self.design @ coefficients) * np.sqrt(self.trust))

    def solve(self, precision: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coefficients, and the lower Cholesky factor of their precision matrix.

        `precision` (n,) is the inverse variance of each row; `prior` is from `_prior_precision`.
        """
        from scipy.linalg import cho_factor, cho_solve  # slow import, not needed at start-up

        weighted = self.design * (self.trust * precision)[:, np.newaxis]
        factor, _ = cho_factor(self.design.T @ weighted + prior, lower=True)
        return cho_solve((factor, True), weighted.T @ self.y), factor


def _resisting(points: _Points, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return robustly fitted coefficients and weights, with a common scatter of all groups."""
    robust, std = np.ones(points.y.size), max(robust_std(points.y), MIN_STD)
    for round_ in range(HUBER_ROUNDS + BISQUARE_ROUNDS):
        coefficients, _ = points.solve(robust / std**2, prior)
        left = points.left(coefficients)
        std = max(robust_std(left), MIN_STD)
        if round_ < HUBER_ROUNDS - 1:
            robust = np.minimum(1.0, HUBER_LIMIT * std / np.maximum(np.abs(left), 1e-12))
        else:
            robust = bisquare(left / std)
    return coefficients, robust


def _std(
    points: _Points, coefficients: FloatArray, robust: FloatArray, slope: FloatArray
) -> FloatArray:
    """Return the scatter of each group (n,) from its slope, fitted to the non-rejected groups."""
    fits = robust > 0.0
    model = slope_scatter(slope[fits], points.left(coefficients)[fits])
    return np.maximum(np.sqrt(model.variance(slope)), MIN_STD)


def refit(groups: Groups, fit: Fit, bend_std: float, is_used: FloatArray) -> Surface:
    """Return the surface refitted, with the weights of `fit`, to groups where `is_used` is 1.

    `bend_std` is the prior standard deviation of the change of slope of ln k between knots.
    """
    shape, offset = fit.surface.shape, fit.surface.offset
    points = _Points.of(groups, shape, offset)
    precision = is_used * fit.robust_weight / (fit.group_std**2 * fit.clustering)
    coefficients, _ = points.solve(precision, _prior_precision(shape, bend_std))
    return Surface(shape, offset, tuple(coefficients.tolist()))


def _prior_precision(shape: SurfaceShape, bend_std: float) -> FloatArray:
    """Return the inverse prior covariance of the coefficients (n_coefficients, n_coefficients)."""
    n_e, n_t = shape.eccentricity.n_splines, shape.temperature.n_splines
    along_e, along_t = _differences(n_e, bend_std), _differences(n_t, bend_std)
    tensor = np.kron(along_e, np.eye(n_t)) + np.kron(np.eye(n_e), along_t)
    precision = np.eye(shape.n_coefficients) / ATTITUDE_STD**2
    precision[: n_e * n_t, : n_e * n_t] = tensor + 1e-9 * np.eye(n_e * n_t)
    return precision


def _differences(n: int, bend_std: float) -> FloatArray:
    slopes, bends = np.diff(np.eye(n), axis=0), np.diff(np.eye(n), 2, axis=0)
    return np.asarray(slopes.T @ slopes / SLOPE_STD**2 + bends.T @ bends / bend_std**2)


def _clustering(
    points: _Points, coefficients: FloatArray, robust: FloatArray, std: FloatArray
) -> float:
    """Return the variance of means over time blocks, relative to independent groups; at least 1."""
    standardised = (points.y - points.design @ coefficients) / std
    weight, found = points.trust * robust, [1.0]
    for span in SPANS_DAYS:
        _, part = np.unique(points.day // span, return_inverse=True)
        total = np.bincount(part, weight * standardised)
        expected = np.bincount(part, weight**2)
        mean = total / np.sqrt(np.maximum(expected, 1e-12))
        found.append(robust_std(mean) ** 2 * (1.0 + 2.0 / mean.size))
    return max(found)


def _surface_shape(groups: Groups, settings: BaselineSettings) -> SurfaceShape:
    """Return the shape of a surface whose knots cover all groups."""
    conditions, grid, knots = groups.conditions, settings.grid, settings.knot_cells
    return SurfaceShape(
        _axis(conditions.eccentricity_ratio, knots * grid.eccentricity_width),
        _axis(conditions.oil_temperature_c, knots * grid.temperature_width_c),
        settings.has_attitude,
    )


def _axis(x: FloatArray, width: float) -> KnotAxis:
    first, last = np.floor(np.min(x) / width), np.floor(np.max(x) / width)
    return KnotAxis(float(first * width), width, int(last - first) + 1)
