"""Roundness of the shaft orbit at one spectral line, and frequency of the part-load vortex."""

from collections.abc import Sequence

import numpy as np

from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y, CrossSpectrum
from core.spectra.lines import peak_frequency_hz


def roundness(spectrum: CrossSpectrum, line: int) -> float:
    """Return the roundness 2 Im(S_xy) / (S_xx + S_yy), -1 to 1, of the shaft orbit at a line.

    1 is a forward circle, 0 a straight line or no motion, -1 a backward circle. In forward motion,
    u_y lags u_x by 90°, and the imaginary part of their cross-spectrum is positive.
    """
    matrix = spectrum.matrix[line]
    whole = float(matrix[SHAFT_X, SHAFT_X].real + matrix[SHAFT_Y, SHAFT_Y].real)
    return 2.0 * float(matrix[SHAFT_X, SHAFT_Y].imag) / whole if whole > 0.0 else 0.0


def vortex_frequency_hz(
    spectra: Sequence[CrossSpectrum], band_hz: tuple[float, float]
) -> float | None:
    """Return the frequency in Hz of the strongest line shared by shaft and bearing in a band.

    The shaft's power is weighted by its coherence with the bearing's motion, corrected for the bias
    of few segments, and summed over directions and bearings. A line of one probe alone (runout,
    mains, a loose cable) does not count. `spectra` are those of one or more bearings, at the same
    lines. None if no line of the band is a peak, or if none is coherent.
    """
    frequency_hz = spectra[0].frequency_hz
    shared = np.zeros(frequency_hz.size)
    for spectrum in spectra:
        for shaft, bearing in ((SHAFT_X, BEARING_X), (SHAFT_Y, BEARING_Y)):
            n_segments = max(int(spectrum.n_segments[shaft, bearing]), 2)
            chance = 1.0 / n_segments  # mean coherence of unrelated signals
            coherence = np.maximum(spectrum.coherence(shaft, bearing) - chance, 0.0)
            shared += spectrum.power[:, shaft, bearing] * coherence / (1.0 - chance)
    return peak_frequency_hz(shared, frequency_hz, band_hz)
