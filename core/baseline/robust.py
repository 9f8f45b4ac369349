"""Location and scale that a minority of wrong readings cannot move far."""

import numpy as np

from core.arrays import FloatArray

STD_PER_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

BISQUARE_LIMIT = 4.685
"""Standard deviations beyond which Tukey's bisquare counts a value as nothing; 95 % efficient where
all are normal (Maronna, Martin and Yohai, Robust Statistics, 2.2)."""


def robust_std(deviation: FloatArray) -> float:
    """Standard deviation about zero, from the median of the absolute deviations."""
    if deviation.size == 0:
        return 0.0
    return STD_PER_MAD * float(np.median(np.abs(deviation)))


def bisquare(standardised: FloatArray) -> FloatArray:
    """Weight of each standardised deviation: 1 at zero, 0 beyond `BISQUARE_LIMIT`."""
    rest = np.clip(1.0 - (standardised / BISQUARE_LIMIT) ** 2, 0.0, 1.0)
    return np.asarray(rest**2)


def absolute_quantile_std(deviation: FloatArray) -> float:
    """Standard deviation about zero of values that need not be normal: the larger of what the
    middle half and the middle three quarters say.
    """  # noqa: D205
    if deviation.size == 0:
        return 0.0
    half, three_quarters = np.quantile(np.abs(deviation), (0.5, 0.75))
    return float(max(STD_PER_MAD * half, three_quarters / 1.1503))
