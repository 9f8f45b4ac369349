"""How much independent evidence Hann-tapered segments and neighbouring bins carry."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray

NOISE_BANDWIDTH_BINS = 1.5
"""Equivalent noise bandwidth of Hann's taper (Harris 1978, table I)."""

BIN_CORRELATION = (1.0, 2.0 / 3.0, 1.0 / 6.0)
"""Of the phasors of white noise in bins 0, 1 and 2 apart: Hann's taper convolved with itself."""

CORRELATED_LINES = 1.0 + 2.0 * sum(rho**2 for rho in BIN_CORRELATION[1:])
"""Neighbouring lines that count as one in a mean of squares, 1.94."""


def phasor_power_per_density(bin_hz: float) -> float:
    """Mean squared 0-to-peak phasor of noise with a one-sided density of 1 per Hz.

    The mean square in a bin is density times noise bandwidth; a 0-to-peak square is twice that.
    """
    return 2.0 * NOISE_BANDWIDTH_BINS * bin_hz


@lru_cache(maxsize=32)
def independent_segments(n_segments: int, overlap: float) -> float:
    """Independent segments that overlapping ones are worth (Welch 1967, equation 12).

    Parameters
    ----------
    overlap
        Share of a segment that the next one repeats, from 0 to below 1.
    """
    position = np.arange(1024) / 1024
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * position)
    excess, lag = 0.0, 1
    while lag < n_segments and lag * (1.0 - overlap) < 1.0:
        shift = round(lag * (1.0 - overlap) * taper.size)
        common = float(taper[shift:] @ taper[: taper.size - shift])
        correlation = common / float(taper @ taper)
        excess += 2.0 * (1.0 - lag / n_segments) * correlation**2
        lag += 1
    return n_segments / (1.0 + excess)


WHITE_PRODUCTS = tuple(rho**2 for rho in BIN_CORRELATION[1:])
"""Correlation, 1 and 2 bins apart, of products of two independent white noises."""

SMEARED_PRODUCTS = (0.0, -1.0 / 12.0)
SMEARED_IN_PHASE = (1.0 / 3.0, 1.0 / 12.0)
"""The same of white noise times what it leaves in a line when each of its parts is integrated with
the line's frequency instead of its own, d times its share in the bins d = -1, 0, 1 of the taper.
The second is taken off for the part in phase with the noise and added for the part in quadrature,
by the cosine of twice the phase."""

SMEAR_BINS_SQUARED = 1.0 / 3.0
"""Variance of the frequency, in bins, that a line of broadband noise holds."""


def neighbour_inflation(
    used: npt.NDArray[np.bool_], products: tuple[float, ...] = WHITE_PRODUCTS
) -> FloatArray:
    """Factor by which correlated neighbours change the variance of a sum over lines.

    A line without used neighbours counts once.

    Parameters
    ----------
    used : (n_lines,)
    products
        Correlation of the summands 1, 2, ... bins apart.

    Returns
    -------
    (n_lines,) 1 to 1.94 for white noise.
    """
    counted = used.astype(np.float64)
    inflation = np.ones_like(counted)
    for distance, correlation in enumerate(products, start=1):
        inflation[distance:] += correlation * counted[:-distance]
        inflation[:-distance] += correlation * counted[distance:]
    return inflation


@lru_cache(maxsize=8)
def leakage_kernel(n_lines: int) -> FloatArray:
    """Share of a line's power that Hann's side lobes may put on others, (n_lines, n_lines).

    Zero within the main lobe. The envelope of the lobes at distance d is ``1 / (π d (d² - 1))``.
    """
    distance = np.abs(np.subtract.outer(np.arange(n_lines), np.arange(n_lines))).astype(np.float64)
    far = distance > 2.0
    kernel = np.zeros_like(distance)
    kernel[far] = (np.pi * distance[far] * (distance[far] ** 2 - 1.0)) ** -2
    kernel.setflags(write=False)
    return kernel
