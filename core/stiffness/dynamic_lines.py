"""Settings of `dynamic`, selection of its spectral lines, and noise floor of the shaft probes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
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
    spectra: Sequence[CrossSpectrum], between: BoolArray, settings: DynamicSettings
) -> list[IntArray]:
    """Return for each spectrum the indices of the lines that have motion and little leakage.

    `between` (n_lines,) is the mask of the lines between the harmonics of the running speed.
    """
    inside = np.flatnonzero(between & _in_band(settings.band_hz, spectra[0]))
    if inside.size == 0:
        return [inside] * len(spectra)
    power = np.array([np.einsum("lii->il", spectrum.matrix).real for spectrum in spectra])
    band, shaft = slice(int(inside[0]), int(inside[-1]) + 1), power[:, :BEARING_X]
    little = little_leakage(shaft.reshape(-1, shaft.shape[-1]).T, band)
    little = np.all(little.reshape(-1, len(spectra), BEARING_X), axis=2)[inside - band.start]
    used = little.T & np.all(power[:, :, inside] > 0.0, axis=1)
    return [inside[own] for own in used]


def _in_band(band_hz: tuple[float, float], spectrum: CrossSpectrum) -> BoolArray:
    """Return a mask of the lines of a band, (n_lines,)."""
    inside: BoolArray = spectrum.frequency_hz >= band_hz[0]
    return inside & (spectrum.frequency_hz <= band_hz[1])


def between_harmonics(
    frequency_hz: FloatArray, turn_hz: tuple[float, float], guard_bins: float
) -> BoolArray:
    """Return a mask of the lines between the harmonics of the running speed, (n_lines,).

    Parameters
    ----------
    frequency_hz : (n_lines,)
        Evenly spaced frequencies.
    turn_hz
        Lowest and highest 1× frequency measured in the averaging window; the guard of the n-th
        harmonic spans n times this range.
    guard_bins
        Smallest distance of a line from the harmonics, in bins.
    """
    lowest, highest = turn_hz
    guard_hz = guard_bins * (frequency_hz[1] - frequency_hz[0])
    # harmonic n guards a line f if n · lowest - guard <= f <= n · highest + guard
    last = np.floor((frequency_hz + guard_hz) / lowest)
    first = np.maximum(np.ceil((frequency_hz - guard_hz) / highest), 1.0)
    return np.asarray(first > last)


def little_leakage(shaft_power: FloatArray, lines: slice = slice(None)) -> BoolArray:
    """Return a mask of the lines with little leakage from stronger lines.

    Parameters
    ----------
    shaft_power : (n_lines, n_channels)
    lines
        Slice of the n lines to check; by default all.

    Returns
    -------
    (n, n_channels)
    """
    leaked = leakage_kernel(shaft_power.shape[0])[lines] @ shaft_power
    return np.asarray(leaked <= MAX_LEAKAGE * shaft_power[lines])


def conditional_power(matrix: ComplexArray, given: ComplexArray, cross: ComplexArray) -> FloatArray:
    """Return the power of two signals that is not coherent with two inputs, (..., 2, n_lines).

    Where the inputs are coherent with each other or one is zero, the whole power is returned.
    Negative results, from rounding, are set to 0.

    Parameters
    ----------
    matrix : (..., 2, 2, n_lines)
        Cross-spectra of the signals.
    given : (..., 2, 2, n_lines)
        Cross-spectra of the two inputs.
    cross : (..., 2, 2, n_lines)
        Cross-spectra of the signals with the inputs, which are conjugated.
    """
    x, y, crossed = given[..., 0, 0, :].real, given[..., 1, 1, :].real, given[..., 0, 1, :]
    product = x * y
    determinant = product - np.abs(crossed) ** 2
    usable = determinant > 1e-12 * product
    to_x, to_y = cross[..., 0, :], cross[..., 1, :]
    mixed = (to_x * crossed[..., np.newaxis, :] * to_y.conj()).real
    explained = (
        np.abs(to_x) ** 2 * y[..., np.newaxis, :] + np.abs(to_y) ** 2 * x[..., np.newaxis, :]
    )
    explained -= 2.0 * mixed
    share = usable / np.where(usable, determinant, 1.0)
    rest: FloatArray = own_power(matrix) - explained * share[..., np.newaxis, :]
    return np.maximum(rest, 0.0)


def own_power(matrix: ComplexArray) -> FloatArray:
    """Return the power of each channel (..., n, n_lines) of cross-spectra (..., n, n, n_lines)."""
    return np.asarray(np.einsum("...iil->...il", matrix).real)


def probe_noise_power(
    spectra: Sequence[CrossSpectrum],
    between: BoolArray,
    settings: DynamicSettings,
    n_segments: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the mean squared phasors of the probes' noise, known or estimated in the quiet band.

    The part of the shaft spectra coherent with the bearing is motion and is subtracted. The rest is
    noise of the probes and, through the film, of the bearing transducers; the latter biases the
    estimate upwards.

    `between` (n_lines,) is the mask of the lines between the harmonics of the running speed, and
    `n_segments` (n, 1) the number of independent segments of each average, at least 3. `settings`
    give the quiet band and the known noise.

    Returns
    -------
    Power of each probe's noise, (n, 2) in µm², zero without lines in the quiet band; and its
    relative standard uncertainty, (n, 2), zero if the power is known.
    """
    nothing = np.zeros((len(spectra), 2))
    if settings.probe_noise_um2_per_hz is not None:
        bin_hz = float(spectra[0].frequency_hz[1] - spectra[0].frequency_hz[0])
        known = phasor_power_per_density(bin_hz) * np.array(settings.probe_noise_um2_per_hz)
        return nothing + known, nothing
    quiet = np.flatnonzero(between & _in_band(settings.quiet_band_hz, spectra[0]))
    if quiet.size == 0:
        return nothing, nothing
    matrix = np.array([spectrum.matrix[quiet] for spectrum in spectra]).transpose(0, 2, 3, 1)
    shaft, bearing = slice(0, BEARING_X), slice(BEARING_X, None)
    rest = conditional_power(
        matrix[:, shaft, shaft], matrix[:, bearing, bearing], matrix[:, shaft, bearing]
    )
    n_blocks = min(N_BLOCKS, quiet.size)
    edges = quiet.size * np.arange(n_blocks + 1) // n_blocks
    counts = edges[1:] - edges[:-1]
    sums = np.add.reduceat(rest, edges[:-1], axis=-1)
    # two fitted inputs take two degrees of freedom (Bendat and Piersol, 9.3)
    freedoms = n_segments - 2.0
    spread = np.sqrt(CORRELATED_LINES / (counts.min() * freedoms))[..., np.newaxis]
    # average all parts with the same floor: the lowest part alone would be biased low
    lowest = (sums / counts).min(axis=-1, keepdims=True)
    same = sums / counts <= (1.0 + SAME_FLOOR * math.sqrt(2.0) * spread) * lowest
    counted: FloatArray = (counts * same).sum(axis=-1)
    floor: FloatArray = (sums * same).sum(axis=-1) / counted
    return floor * n_segments / freedoms, np.sqrt(CORRELATED_LINES / (counted * freedoms))
