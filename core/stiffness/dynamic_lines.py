"""Settings of `dynamic`, selection of its spectral lines, and noise floor of the shaft probes."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import (
    BEARING_X,
    CORRELATED_LINES,
    CrossSpectrum,
    leakage_kernel,
    phasor_power_per_density,
)

MAX_LEAKAGE = 0.005
"""Largest fraction of a line's shaft power that may be leakage from stronger lines. Leakage
contains runout and is integrated with the wrong frequency."""

N_BLOCKS = 4
"""Number of parts of the quiet band, each with its own noise floor."""

SAME_FLOOR = 3.0
"""Largest difference of averaged parts from the floor of the quietest, in standard deviations."""


@dataclass(frozen=True)
class DynamicSettings:
    """Settings of the `dynamic` estimator: band, probe noise and required evidence.

    Parameters
    ----------
    band_hz
        Band of the used lines, which lie between the harmonics of the running speed.
    guard_bins
        Smallest distance of lines from harmonics. Hann's main lobe reaches 2 bins; the third bin
        allows for speed changes within a segment.
    probe_noise_um2_per_hz
        Known one-sided noise density (x, y) of the shaft probes; ``None`` estimates it.
    quiet_band_hz
        Band in which the noise density is estimated. The shaft hardly moves there; motion that is
        coherent with the bearing channels is subtracted.
    min_segments
        Smallest number of segments for a result; at least 3, because two inputs are fitted.
    min_signal_share
        Smallest fraction of the shaft's weighted power that is not noise, in the worst direction.
    min_coherence
        Smallest `coherence` of a `DynamicStiffness` in each direction.
    max_relative_uncertainty
        Largest random standard uncertainty of a direct stiffness, relative to the larger direct
        stiffness; beyond it the excitation is insufficient.
    overlap
        Overlap of consecutive segments as a fraction of a segment.
    """

    band_hz: tuple[float, float] = (0.6, 12.0)
    guard_bins: float = 3.0
    probe_noise_um2_per_hz: tuple[float, float] | None = None
    quiet_band_hz: tuple[float, float] = (15.0, 25.0)
    min_segments: int = 4
    min_signal_share: float = 0.5
    min_coherence: float = 0.1
    max_relative_uncertainty: float = 0.2
    overlap: float = 0.125


def used_lines(
    spectrum: CrossSpectrum, turn_hz: tuple[float, float], settings: DynamicSettings
) -> npt.NDArray[np.int64]:
    """Return the indices of the lines between harmonics that have motion and little leakage."""
    power = np.diagonal(spectrum.matrix, axis1=1, axis2=2).real
    used = _between_harmonics_of(settings.band_hz, spectrum, turn_hz, settings)
    used &= np.all(power > 0.0, axis=1)
    inside = np.flatnonzero(used)
    if inside.size:
        band = slice(int(inside[0]), int(inside[-1]) + 1)
        used[band] &= little_leakage(power[:, :BEARING_X], band)
    return np.flatnonzero(used)


def _between_harmonics_of(
    band_hz: tuple[float, float],
    spectrum: CrossSpectrum,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
) -> npt.NDArray[np.bool_]:
    """Return a mask of the lines of a band between the harmonics, (n_lines,)."""
    inside = (spectrum.frequency_hz >= band_hz[0]) & (spectrum.frequency_hz <= band_hz[1])
    return inside & between_harmonics(spectrum.frequency_hz, turn_hz, settings.guard_bins)


def between_harmonics(
    frequency_hz: FloatArray, turn_hz: tuple[float, float], guard_bins: float
) -> npt.NDArray[np.bool_]:
    """Return a mask of the lines between the harmonics of the running speed, (n_lines,).

    Parameters
    ----------
    frequency_hz : (n_lines,)
        Evenly spaced frequencies.
    turn_hz
        Lowest and highest 1× frequency measured in the averaging window; the guard of the n-th
        harmonic spans n times this range.

    Raises
    ------
    ValueError
        If the 1× frequencies are not positive and ascending.
    """
    lowest, highest = turn_hz
    if not 0.0 < lowest <= highest:
        raise ValueError(f"turn_hz must be 0 < lowest <= highest, got {turn_hz} Hz")
    guard_hz = guard_bins * (frequency_hz[1] - frequency_hz[0])
    # harmonic n guards a line f if n · lowest - guard <= f <= n · highest + guard
    last = np.floor((frequency_hz + guard_hz) / lowest)
    first = np.maximum(np.ceil((frequency_hz - guard_hz) / highest), 1.0)
    clear: npt.NDArray[np.bool_] = first > last
    return clear


def little_leakage(shaft_power: FloatArray, lines: slice = slice(None)) -> npt.NDArray[np.bool_]:
    """Return a mask of the lines with little leakage from stronger lines.

    Parameters
    ----------
    shaft_power : (n_lines, n_channels)
    lines
        Slice of the n lines to check; by default all.

    Returns
    -------
    (n,)
    """
    leaked = leakage_kernel(shaft_power.shape[0])[lines] @ shaft_power
    own: npt.NDArray[np.bool_] = np.all(leaked <= MAX_LEAKAGE * shaft_power[lines], axis=1)
    return own


def conditional_power(matrix: ComplexArray, given: ComplexArray, cross: ComplexArray) -> FloatArray:
    """Return the power of n signals that is not coherent with two inputs, (n_lines, n).

    Parameters
    ----------
    matrix : (n_lines, n, n)
        Cross-spectra of the signals.
    given : (n_lines, 2, 2)
        Cross-spectra of the two inputs.
    cross : (n_lines, n, 2)
        Cross-spectra of the signals with the inputs, which are conjugated.
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
    spectrum: CrossSpectrum,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_segments: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the mean squared phasors of the probes' noise, known or estimated in the quiet band.

    The part of the shaft spectra coherent with the bearing is motion and is subtracted. The rest is
    noise of the probes and, through the film, of the bearing transducers; the latter biases the
    estimate upwards.

    Parameters
    ----------
    n_segments
        Number of independent segments of the average; at least 3.

    Returns
    -------
    Power of each probe's noise, (2,) in µm², zero without lines in the quiet band; and its relative
    standard uncertainty, (2,), zero if the power is known.
    """
    if settings.probe_noise_um2_per_hz is not None:
        bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
        known = phasor_power_per_density(bin_hz) * np.array(settings.probe_noise_um2_per_hz)
        return known, np.zeros(2)
    quiet = _between_harmonics_of(settings.quiet_band_hz, spectrum, turn_hz, settings)
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
    # two fitted inputs take two degrees of freedom (Bendat and Piersol, 9.3)
    freedoms = n_segments - 2.0
    spread = math.sqrt(CORRELATED_LINES / (counts.min() * freedoms))
    # average all parts with the same floor: the lowest part alone would be biased low
    same = sums / counts <= (1.0 + SAME_FLOOR * math.sqrt(2.0) * spread) * (sums / counts).min(
        axis=0
    )
    counted: FloatArray = (counts * same).sum(axis=0)
    floor: FloatArray = (sums * same).sum(axis=0) / counted
    return floor * n_segments / freedoms, np.sqrt(CORRELATED_LINES / (counted * freedoms))
