"""The noise floor of the shaft probes, known or read from a quiet band."""

import math

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import BEARING_X, CORRELATED_LINES, CrossSpectrum

N_BLOCKS = 4
"""Parts of the quiet band, in case the shaft moves unseen in some of them."""

SAME_FLOOR = 3.0
"""Standard deviations within which a part shows the same floor as the quietest."""


def conditional_power(matrix: ComplexArray, given: ComplexArray, cross: ComplexArray) -> FloatArray:
    """Power of signals that two others do not explain, (n_lines, n).

    Parameters
    ----------
    matrix : (n_lines, n, n)
        Spectra of the signals.
    given : (n_lines, 2, 2)
        Spectra of the two others.
    cross : (n_lines, n, 2)
        Signals times conjugated others.
    """
    determinant = (given[:, 0, 0] * given[:, 1, 1]).real - np.abs(given[:, 0, 1]) ** 2
    usable = determinant > 1e-12 * (given[:, 0, 0] * given[:, 1, 1]).real
    adjugate = np.empty_like(given)
    adjugate[:, 0, 0], adjugate[:, 1, 1] = given[:, 1, 1], given[:, 0, 0]
    adjugate[:, 0, 1], adjugate[:, 1, 0] = -given[:, 0, 1], -given[:, 1, 0]
    explained = ((cross @ adjugate) * cross.conj()).sum(axis=2).real
    own: FloatArray = np.diagonal(matrix, axis1=1, axis2=2).real.copy()
    own[usable] -= explained[usable] / determinant[usable, np.newaxis]
    return np.maximum(own, 0.0)


def probe_noise_power(
    spectrum: CrossSpectrum, quiet: npt.NDArray[np.bool_], n_segments: float
) -> tuple[FloatArray, FloatArray]:
    """Mean squared phasor of the probes' noise, from lines in a quiet band.

    What shaft and bearing have in common is motion and does not count; the rest is the probes'
    noise and, through the film, the bearing transducers'. Where those are quiet the estimate is
    true, else it is high.

    Parameters
    ----------
    quiet : (n_lines,)
        The lines of the quiet band.
    n_segments
        Independent segments of the average; at least 3.

    Returns
    -------
    (2,) in µm², zero if no line is quiet; and their relative standard uncertainties, (2,).
    """
    matrix = spectrum.matrix[quiet]
    if matrix.shape[0] == 0:
        return np.zeros(2), np.zeros(2)
    shaft, bearing = slice(0, BEARING_X), slice(BEARING_X, None)
    rest = conditional_power(
        matrix[:, shaft, shaft], matrix[:, bearing, bearing], matrix[:, shaft, bearing]
    )
    n_blocks = min(N_BLOCKS, rest.shape[0])
    edges = np.linspace(0, rest.shape[0], n_blocks + 1).astype(np.int64)[:-1]
    counts = np.diff(np.append(edges, rest.shape[0]))[:, np.newaxis]
    sums = np.add.reduceat(rest, edges, axis=0)
    # two fitted signals take two of the segments' freedoms (Bendat and Piersol, 9.3)
    freedoms = n_segments - 2.0
    spread = math.sqrt(CORRELATED_LINES / (counts.min() * freedoms))
    # the mean of all parts that show the same floor: the least alone would be low by chance
    same = sums / counts <= (1.0 + SAME_FLOOR * math.sqrt(2.0) * spread) * (sums / counts).min(
        axis=0
    )
    counted: FloatArray = (counts * same).sum(axis=0)
    floor: FloatArray = (sums * same).sum(axis=0) / counted
    return floor * n_segments / freedoms, np.sqrt(CORRELATED_LINES / (counted * freedoms))
