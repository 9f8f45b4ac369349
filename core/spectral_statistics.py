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


def neighbour_inflation(used: npt.NDArray[np.bool_]) -> FloatArray:
    """Factor by which correlated neighbours raise the variance of a sum over lines.

    Products of two independent signals, each correlated between bins, correlate with the square of
    that. A line without used neighbours counts once.

    Parameters
    ----------
    used : (n_lines,)

    Returns
    -------
    (n_lines,) 1 to 1.94.
    """
    counted = used.astype(np.float64)
    inflation = np.ones_like(counted)
    for distance, correlation in enumerate(BIN_CORRELATION[1:], start=1):
        inflation[distance:] += correlation**2 * counted[:-distance]
        inflation[:-distance] += correlation**2 * counted[distance:]
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
