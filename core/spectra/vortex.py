"""Which way the shaft turns in its bearing at one line, and where the vortex is."""

import math
from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y, CrossSpectrum
from core.spectra.lines import peak_frequency_hz


class Whirl(StrEnum):
    """Sense of an orbit, from the positive x axis towards the positive y axis."""

    FORWARD = "forward"
    BACKWARD = "backward"
    UNDECIDED = "undecided"


LEAST_ROUNDNESS = 0.1
"""Below this an orbit is a line whose sense means nothing."""


def roundness(spectrum: CrossSpectrum, line: int) -> float:
    """Roundness of the orbit: 1 a forward circle, 0 a straight line, -1 a backward circle.

    Forward motion has u_y a quarter turn behind u_x, so that the imaginary part of their
    cross-spectrum is positive.
    """
    matrix = spectrum.matrix[line]
    whole = float(matrix[SHAFT_X, SHAFT_X].real + matrix[SHAFT_Y, SHAFT_Y].real)
    return 2.0 * float(matrix[SHAFT_X, SHAFT_Y].imag) / whole if whole > 0.0 else 0.0


def whirl(spectrum: CrossSpectrum, line: int) -> Whirl:
    """Tell the sense of the orbit, where it is round enough and not chance.

    Two unrelated signals of n segments seem round by 1 / √(2n); twice that must be passed.
    """
    value = roundness(spectrum, line)
    n_segments = int(spectrum.n_segments[SHAFT_X, SHAFT_Y])
    chance = math.sqrt(2.0 / n_segments) if n_segments else 1.0
    if abs(value) < max(LEAST_ROUNDNESS, chance):
        return Whirl.UNDECIDED
    return Whirl.FORWARD if value > 0.0 else Whirl.BACKWARD


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
