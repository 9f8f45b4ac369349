"""Averaged cross-spectra of the four channels of a bearing, their statistics and vortex line."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from core.spectra.lines import hann

SHAFT_X, SHAFT_Y, BEARING_X, BEARING_Y = range(4)
"""Indices of a bearing's four channels in all matrices."""


@dataclass(frozen=True)
class CrossSpectrum:
    """Cross-spectrum of the channels of a bearing, averaged over segments.

    Each pair of channels is averaged over the segments in which both are usable. A failed channel
    does not affect the others, and compared amplitudes come from the same segments.

    Parameters
    ----------
    frequency_hz : (n_lines,)
    matrix : (n_lines, n_channels, n_channels)
        Mean of ``P_i · conj(P_j)`` of the zero-to-peak displacement phasors, µm². Hermitian.
    power : (n_lines, n_channels, n_channels)
        Mean of ``|P_i|²`` over the segments in which both i and j are usable, µm².
    n_segments : (n_channels, n_channels)
        Number of segments in which both i and j are usable.
    """

    frequency_hz: FloatArray
    matrix: ComplexArray
    power: FloatArray
    n_segments: IntArray

    def amplitude_um_pk(self, channel: int) -> FloatArray:
        """Return the rms over the segments of a channel's amplitudes in µm 0-pk, (n_lines,)."""
        return np.asarray(np.sqrt(self.power[:, channel, channel]))

    def rotating_um_pk(self, x: int, y: int) -> FloatArray:
        """Return the amplitudes of motion from x to y and from y to x in µm 0-pk, (2, n_lines).

        At each line, the path of the channels x and y is the sum of two circles of these radii, one
        in each direction (Goldman and Muszynska 1999, full spectrum).
        """
        both = self.power[:, x, y] + self.power[:, y, x]
        turn = 2.0 * self.matrix[:, x, y].imag
        return np.sqrt(np.maximum(np.stack([both + turn, both - turn]), 0.0)) / 2.0

    def amplitude_ratio(self, numerator: int, denominator: int) -> FloatArray:
        """Return the amplitude ratio (n_lines,) of two channels, by index, over common segments.

        It is zero where the denominator is zero; `line_excitation` excludes such lines.
        """
        below = self.power[:, denominator, numerator]
        ratio = np.divide(
            self.power[:, numerator, denominator], below, out=np.zeros_like(below), where=below > 0
        )
        return np.asarray(np.sqrt(ratio))

    def coherence(self, first: int, second: int) -> FloatArray:
        """Return the squared coherence of two channels, given by index, (n_lines,).

        It is always 1 for one segment, and 0 where a channel has no power.
        """
        product = self.power[:, first, second] * self.power[:, second, first]
        squared = np.abs(self.matrix[:, first, second]) ** 2
        coherence: FloatArray = np.divide(
            squared, product, out=np.zeros_like(squared), where=product > 0
        )
        return np.minimum(coherence, 1.0)

    def coherence_at(self, line: int, first: int, second: int) -> float:
        """Return the squared coherence of two channels at one line; 0 without power."""
        product = float(self.power[line, first, second]) * float(self.power[line, second, first])
        squared = abs(complex(self.matrix[line, first, second])) ** 2
        return min(squared / product, 1.0) if product > 0.0 else 0.0


NO_SPECTRUM = CrossSpectrum(
    np.zeros(0), np.zeros((0, 4, 4), complex), np.zeros((0, 4, 4)), np.zeros((4, 4), np.int64)
)
"""Empty cross-spectrum, for input without waveforms."""


def average(
    frequency_hz: FloatArray, phasors_um_pk: ComplexArray, usable: BoolArray
) -> CrossSpectrum:
    """Return the cross-spectrum averaged over segments.

    Parameters
    ----------
    frequency_hz : (n_lines,)
        Frequencies of the lines.
    phasors_um_pk : (n_segments, n_channels, n_lines)
        Phasors of each segment at these frequencies; finite, also where not usable.
    usable : (n_segments, n_channels)
        Whether the channel is usable in the whole segment.
    """
    all_usable = bool(usable.all())
    counted = phasors_um_pk if all_usable else phasors_um_pk * usable[:, :, np.newaxis]
    by_line = np.ascontiguousarray(counted.transpose(2, 1, 0))  # (n_lines, n_channels, n_segments)
    weight = usable.astype(np.float64)
    n_segments = weight.T @ weight
    divisor = np.maximum(n_segments, 1.0)
    matrix = by_line @ by_line.conj().transpose(0, 2, 1) / divisor
    if all_usable:
        own = np.diagonal(matrix, axis1=1, axis2=2).real
        power = np.repeat(own[:, :, np.newaxis], usable.shape[1], axis=2)
    else:
        power = (by_line.real**2 + by_line.imag**2) @ weight / divisor
    return CrossSpectrum(frequency_hz, matrix, power, n_segments.astype(np.int64))


NOISE_BANDWIDTH_BINS = 1.5
"""Equivalent noise bandwidth of Hann's taper (Harris 1978, table I)."""

BIN_CORRELATION = (1.0, 2.0 / 3.0, 1.0 / 6.0)
"""Correlation of white-noise phasors 0, 1 and 2 bins apart: Hann's taper convolved with itself."""

CORRELATED_LINES = 1.0 + 2.0 * sum(rho**2 for rho in BIN_CORRELATION[1:])
"""Number of adjacent lines that, in a mean of squares, equal one independent line: 1.94."""


def phasor_power_per_density(bin_hz: float) -> float:
    """Return the mean squared 0-to-peak phasor of noise with a one-sided density of 1 per Hz.

    The mean square in a bin is density times noise bandwidth; a 0-to-peak square is twice that.
    """
    return 2.0 * NOISE_BANDWIDTH_BINS * bin_hz


@lru_cache(maxsize=32)
def independent_segments(n_segments: int, overlap: float) -> float:
    """Return the number of independent segments equivalent to overlapping, Hann-tapered segments.

    `overlap` is the overlapping fraction of consecutive segments, from 0 to below 1. The formula is
    equation 12 of Welch (1967).
    """
    taper = hann(1024)
    excess, lag = 0.0, 1
    while lag < n_segments and lag * (1.0 - overlap) < 1.0:
        shift = round(lag * (1.0 - overlap) * taper.size)
        common = float(taper[shift:] @ taper[: taper.size - shift])
        correlation = common / float(taper @ taper)
        excess += 2.0 * (1.0 - lag / n_segments) * correlation**2
        lag += 1
    return n_segments / (1.0 + excess)


WHITE_PRODUCTS = (1.0, *(rho**2 for rho in BIN_CORRELATION[1:]))
"""Correlation of the products of two independent white noises, for lines 0, 1 and 2 bins apart."""

SMEARED_IN_PHASE = (1.0, -1.0 / 3.0, -1.0 / 6.0)
SMEARED_IN_QUADRATURE = (1.0, 1.0 / 3.0, 0.0)
SMEARED_APART = (1.0, 0.0, -1.0 / 12.0)
"""Correlation of the products of white noise and its integration error in a line, for lines 0, 1
and 2 bins apart. The error arises because noise d bins off the line is integrated with the line's
frequency instead of its own; the error is d times the taper's weight at d = -1, 0, 1. The products
are with noise in phase, in quadrature, and independent. In phase, the errors of neighbouring lines
cancel; only those at the ends of a run of lines remain."""

SMEAR_BINS_SQUARED = 1.0 / 3.0
"""Variance of the frequencies, in bins squared, that contribute to a line of broadband noise."""


def correlated_sum(terms: FloatArray, lines: IntArray, products: FloatArray) -> FloatArray:
    """Return the covariance matrices of sums over lines whose terms are correlated.

    Terms are correlated if their lines are at most 2 bins apart. n is the number of sets of lines.

    Parameters
    ----------
    terms : (n, ..., n_sums, n_parts, n_lines)
        Standard deviation of each term of each sum, for each of its independent real parts.
    lines : (n, n_lines)
        Bin index of each line, ascending.
    products : (3, n_parts)
        Correlation of each part 0, 1 and 2 bins apart; 1 for the same line.

    Returns
    -------
    (n, ..., n_sums, n_sums); no variance is negative if `products` are correlations of a real
    process.
    """
    apart = np.zeros((4, products.shape[1]))
    apart[:3] = products
    smoothed = terms.copy()
    for places in (1, 2):  # lines 2 bins apart may be neighbours
        distance = np.minimum(lines[:, places:] - lines[:, :-places], 3)
        correlation = 2.0 * np.ascontiguousarray(apart[distance].swapaxes(1, 2))
        shape = len(lines), *(1,) * (terms.ndim - 3), *correlation.shape[1:]
        smoothed[..., :-places] += correlation.reshape(shape) * terms[..., places:]
    flat = (*terms.shape[:-2], -1)
    covariance: FloatArray = smoothed.reshape(flat) @ np.swapaxes(terms.reshape(flat), -1, -2)
    return 0.5 * (covariance + np.swapaxes(covariance, -1, -2))


@lru_cache(maxsize=8)
def leakage_kernel(n_lines: int) -> FloatArray:
    """Return the largest fraction of line power that leaks to other lines, (n_lines, n_lines).

    It is zero within Hann's main lobe. At a distance of d bins, it is the square of the side lobes'
    envelope ``1 / (π d (d² - 1))``.
    """
    distance = np.abs(np.subtract.outer(np.arange(n_lines), np.arange(n_lines))).astype(np.float64)
    far = distance > 2.0
    kernel = np.zeros_like(distance)
    kernel[far] = (np.pi * distance[far] * (distance[far] ** 2 - 1.0)) ** -2
    kernel.setflags(write=False)
    return kernel


def roundness(spectrum: CrossSpectrum, line: int) -> float:
    """Return the roundness 2 Im(S_xy) / (S_xx + S_yy), -1 to 1, of the shaft orbit at a line.

    1 is a forward circle, 0 a straight line or no motion, -1 a backward circle. In forward motion,
    u_y lags u_x by 90°, and the imaginary part of their cross-spectrum is positive.
    """
    matrix = spectrum.matrix[line]
    whole = float(matrix[SHAFT_X, SHAFT_X].real + matrix[SHAFT_Y, SHAFT_Y].real)
    return 2.0 * float(matrix[SHAFT_X, SHAFT_Y].imag) / whole if whole > 0.0 else 0.0


def shared_power(spectra: Sequence[CrossSpectrum]) -> FloatArray:
    """Return the shaft's power that is coherent with the bearing's motion, µm², (n_lines,).

    The coherence is corrected for the bias of few segments; the power is summed over directions and
    bearings. A line of one probe alone (runout, mains, a loose cable) is not in it. `spectra` are
    those of one or more bearings, at the same lines.
    """
    shared = np.zeros(spectra[0].frequency_hz.size)
    for spectrum in spectra:
        for shaft, bearing in ((SHAFT_X, BEARING_X), (SHAFT_Y, BEARING_Y)):
            n_segments = max(int(spectrum.n_segments[shaft, bearing]), 2)
            chance = 1.0 / n_segments  # mean coherence of unrelated signals
            coherence = np.maximum(spectrum.coherence(shaft, bearing) - chance, 0.0)
            shared += spectrum.power[:, shaft, bearing] * coherence / (1.0 - chance)
    return shared
