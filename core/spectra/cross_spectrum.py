"""`CrossSpectrum`: how four signals of a bearing vary together, line by line."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray

SHAFT_X, SHAFT_Y, BEARING_X, BEARING_Y = range(4)
"""Where the channels of a bearing stand in every matrix."""


@dataclass(frozen=True)
class CrossSpectrum:
    """Averages over segments; every spectral result of padwatch is a pure function of this.

    Two channels are averaged over the segments in which both are usable, so that a failed channel
    takes nothing from the others, and amplitudes that are compared come from the same time.

    Parameters
    ----------
    frequency_hz : (n_lines,)
    matrix : (n_lines, n_channels, n_channels)
        Mean of ``P_i · conj(P_j)`` of the zero-to-peak displacement phasors, µm². Hermitian.
    power : (n_lines, n_channels, n_channels)
        Mean of ``|P_i|²`` over the segments in which both i and j are usable, µm².
    n_segments : (n_channels, n_channels)
        How many those are.
    """

    frequency_hz: FloatArray
    matrix: ComplexArray
    power: FloatArray
    n_segments: npt.NDArray[np.int64]

    def amplitude_um_pk(self, channel: int) -> FloatArray:
        """Root mean square over the segments of a channel's line amplitudes, (n_lines,)."""
        amplitude: FloatArray = np.sqrt(self.power[:, channel, channel])
        return amplitude

    def amplitude_ratio(self, numerator: int, denominator: int) -> FloatArray:
        """Ratio of two channels' amplitudes over their common segments, (n_lines,).

        Zero where the denominator is zero: no motion, no ratio; the excitation guard's business.
        """
        below = self.power[:, denominator, numerator]
        ratio = np.divide(
            self.power[:, numerator, denominator], below, out=np.zeros_like(below), where=below > 0
        )
        root: FloatArray = np.sqrt(ratio)
        return root

    def coherence(self, first: int, second: int) -> FloatArray:
        """Squared coherence of two channels, (n_lines,), 0 to 1; always 1 for one segment."""
        product = self.power[:, first, second] * self.power[:, second, first]
        squared = np.abs(self.matrix[:, first, second]) ** 2
        coherence: FloatArray = np.divide(
            squared, product, out=np.zeros_like(squared), where=product > 0
        )
        return np.minimum(coherence, 1.0)


NO_SPECTRUM = CrossSpectrum(
    np.zeros(0), np.zeros((0, 4, 4), complex), np.zeros((0, 4, 4)), np.zeros((4, 4), np.int64)
)
"""In the place of a spectrum that is not there."""


def average(
    frequency_hz: FloatArray, phasors_um_pk: ComplexArray, usable: npt.NDArray[np.bool_]
) -> CrossSpectrum:
    """Average the phasors of some segments.

    Parameters
    ----------
    frequency_hz : (n_lines,)
    phasors_um_pk : (n_segments, n_channels, n_lines)
        Finite, also where not usable.
    usable : (n_segments, n_channels)
        Whether the channel may be believed throughout the segment.
    """
    counted = phasors_um_pk * usable[:, :, np.newaxis]
    by_line = np.ascontiguousarray(counted.transpose(2, 1, 0))  # (n_lines, n_channels, n_segments)
    weight = usable.astype(np.float64)
    n_segments = weight.T @ weight
    divisor = np.maximum(n_segments, 1.0)
    matrix = by_line @ by_line.conj().transpose(0, 2, 1) / divisor
    own = by_line.real**2 + by_line.imag**2
    if usable.all():
        power = np.repeat(own.mean(axis=2)[:, :, np.newaxis], usable.shape[1], axis=2)
    else:
        power = own @ weight / divisor
    return CrossSpectrum(frequency_hz, matrix, power, n_segments.astype(np.int64))
