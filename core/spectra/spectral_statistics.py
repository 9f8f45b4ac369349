"""How much independent evidence Hann-tapered segments and neighbouring bins carry."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray

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


WHITE_PRODUCTS = (1.0, *(rho**2 for rho in BIN_CORRELATION[1:]))
"""Correlation, 0, 1 and 2 bins apart, of products of two independent white noises."""

SMEARED_IN_PHASE = (1.0, -1.0 / 3.0, -1.0 / 6.0)
SMEARED_IN_QUADRATURE = (1.0, 1.0 / 3.0, 0.0)
SMEARED_APART = (1.0, 0.0, -1.0 / 12.0)
"""The same of white noise times what it leaves in a line when each of its parts is integrated with
the line's frequency instead of its own, d times its share in the bins d = -1, 0, 1 of the taper;
for the factor's part in phase with the noise, in quadrature, and independent of it. In phase, what
one line has too much its neighbours have too little: only the ends of a stretch of lines are
left."""

SMEAR_BINS_SQUARED = 1.0 / 3.0
"""Variance of the frequency, in bins, that a line of broadband noise holds."""


def correlated_sum(
    terms: FloatArray | ComplexArray, lines: npt.NDArray[np.int64], products: tuple[float, ...]
) -> FloatArray:
    """Covariance of a sum over lines, each of several terms, whose neighbours are correlated.

    Parameters
    ----------
    terms : (n_lines, n, m)
        Standard deviations of the n summands' m independent complex parts.
    lines : (n_lines,)
        Which bins they are, rising.
    products
        Correlation of the summands 0, 1, 2, ... bins apart.

    Returns
    -------
    (n, n); with no negative variance, as products are of a real process.
    """
    n = terms.shape[1]
    spread = np.zeros((int(lines[-1] - lines[0]) + 1, n, terms.shape[2]), dtype=np.complex128)
    spread[lines - lines[0]] = terms
    covariance = np.zeros((n, n))
    for distance, correlation in enumerate(products[: spread.shape[0]]):
        stop = spread.shape[0] - distance
        left, right = (
            part.transpose(1, 0, 2).reshape(n, -1) for part in (spread[distance:], spread[:stop])
        )
        product = correlation * (left @ right.conj().T).real
        covariance += product if distance == 0 else product + product.T
    return covariance


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
