"""How far readings stray, given how steeply stiffness rises with eccentricity: a² + b² slope².

An error of the shaft's position counts for more where stiffness rises steeply. What it does is seen
in the contrast to where the surface is flat; slopes that are all alike tell nothing.
"""

from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.baseline.robust import robust_std

MOST_STDS = 3.0
"""Deviations beyond this are taken for this, that wrong ones decide nothing."""

FLAT_SHARE = 0.25
"""Share of the deviations that count as those of a flat surface."""

ROUNDS = 8
LEAST_SCATTER = 1e-6


@dataclass(frozen=True)
class SlopeScatter:
    """Variance of a deviation, given the slope.

    Parameters
    ----------
    flat
        Where the surface is as flat as in `flat_square`, a squared slope, or flatter.
    per_slope
        What a squared slope adds beyond that.
    """

    flat: float
    per_slope: float
    flat_square: float

    def lasting(self, slope: FloatArray) -> FloatArray:
        """Variance that errors of position make at each slope."""
        return self.per_slope * np.maximum(slope**2 - self.flat_square, 0.0)

    def variance(self, slope: FloatArray) -> FloatArray:
        """Variance at each slope."""
        return np.asarray(self.flat + self.lasting(slope))


def slope_scatter(slope: FloatArray, deviation: FloatArray) -> SlopeScatter:
    """Fit variance to squared deviations, each by what is expected of it.

    Parameters
    ----------
    slope, deviation : (n,)
    """
    from scipy.optimize import nnls  # slow to load, and not needed to begin

    flat_square = float(np.quantile(slope**2, FLAT_SHARE))
    steep = np.maximum(slope**2 - flat_square, 0.0)
    terms = np.stack([np.ones(slope.size), steep], axis=1)
    expected = np.full(slope.size, max(robust_std(deviation), LEAST_SCATTER) ** 2)
    flat, per_slope = LEAST_SCATTER**2, 0.0
    for _ in range(ROUNDS):
        square = np.minimum(deviation**2, MOST_STDS**2 * expected)
        (flat, per_slope), _ = nnls(terms / expected[:, np.newaxis], square / expected)
        expected = np.maximum(terms @ (flat, per_slope), LEAST_SCATTER**2)
    return SlopeScatter(max(float(flat), LEAST_SCATTER**2), float(per_slope), flat_square)
