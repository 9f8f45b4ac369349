"""Which way the shaft turns in its bearing at one line, and where the vortex is."""

from collections.abc import Sequence

import numpy as np

from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y, CrossSpectrum
from core.spectra.lines import peak_frequency_hz


def roundness(spectrum: CrossSpectrum, line: int) -> float:
    """Roundness of the orbit: 1 a forward circle, 0 a straight line, -1 a backward circle.

    Forward motion has u_y a quarter turn behind u_x, so that the imaginary part of their
    cross-spectrum is positive.
    """
    matrix = spectrum.matrix[line]
    whole = float(matrix[SHAFT_X, SHAFT_X].real + matrix[SHAFT_Y, SHAFT_Y].real)
    return 2.0 * float(matrix[SHAFT_X, SHAFT_Y].imag) / whole if whole > 0.0 else 0.0


def vortex_frequency_hz(
    spectra: Sequence[CrossSpectrum], band_hz: tuple[float, float]
) -> float | None:
    """Find the strongest line of shaft motion that the bearings share.

    The shaft's power is weighted by its coherence with the bearing's motion, free of the bias of
    few segments, and summed over directions and bearings. A line of one probe alone (runout, mains,
    a loose cable) does not count.

    Parameters
    ----------
    spectra
        Of the bearings of a unit, at the same lines.

    Returns
    -------
    None when no line of the band stands out as a peak, or when nothing is coherent there.
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
