"""Settings of `dynamic`, the lines that it uses, and the noise floor of the shaft probes."""

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
"""Largest share of a line's shaft power that may have come through side lobes of stronger lines.
Leakage carries runout, and it carries the wrong frequency into integration."""

N_BLOCKS = 4
"""Parts of the quiet band, in case the shaft moves unseen in some of them."""

SAME_FLOOR = 3.0
"""Standard deviations within which a part shows the same floor as the quietest."""


@dataclass(frozen=True)
class DynamicSettings:
    """Band, lines, weighting and evidence of the `dynamic` estimator.

    Parameters
    ----------
    band_hz
        Lines are taken from here, between the harmonics of the running speed.
    guard_bins
        Distance of lines from every harmonic. Hann's main lobe reaches 2 bins; the third takes up
        what the tone wanders within a segment.
    probe_noise_um2_per_hz
        Known one-sided noise density (x, y) of the shaft probes; ``None`` estimates it.
    quiet_band_hz
        Where it is estimated: the shaft hardly moves there, and what it moves shows in the
        bearing channels and is taken out.
    min_segments
        Below this there is no result; at least 3, as two inputs are fitted.
    min_signal_share
        Share of the shaft's weighted motion, in its worst direction, that must not be noise.
    min_coherence
        Multiple coherence of bearing with shaft motion over the used lines, free of its bias.
    max_relative_uncertainty
        Random standard uncertainty of a direct stiffness over the larger direct one; beyond it
        the excitation is insufficient.
    overlap
        Share of a segment that the next one repeats.
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
    """Indices of the lines that carry the shaft's own broadband motion and some bearing motion."""
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
    """Lines of a band between the harmonics, (n_lines,)."""
    inside = (spectrum.frequency_hz >= band_hz[0]) & (spectrum.frequency_hz <= band_hz[1])
    return inside & between_harmonics(spectrum.frequency_hz, turn_hz, settings.guard_bins)


def between_harmonics(
    frequency_hz: FloatArray, turn_hz: tuple[float, float], guard_bins: float
) -> npt.NDArray[np.bool_]:
    """Which lines lie between the harmonics of the running speed.

    Parameters
    ----------
    frequency_hz : (n_lines,)
        Evenly spaced.
    turn_hz
        Lowest and highest 1× frequency that was measured during the averaging time; the guard of
        the n-th harmonic spans n times that.

    Raises
    ------
    ValueError
        If the frequencies are not positive and in order.
    """
    lowest, highest = turn_hz
    if not 0.0 < lowest <= highest:
        raise ValueError(f"1× must lie between positive limits in order, got {turn_hz} Hz")
    guard_hz = guard_bins * (frequency_hz[1] - frequency_hz[0])
    # harmonic n guards a line f if n · lowest - guard <= f <= n · highest + guard
    last = np.floor((frequency_hz + guard_hz) / lowest)
    first = np.maximum(np.ceil((frequency_hz - guard_hz) / highest), 1.0)
    clear: npt.NDArray[np.bool_] = first > last
    return clear


def little_leakage(shaft_power: FloatArray, lines: slice = slice(None)) -> npt.NDArray[np.bool_]:
    """Which lines are their own, not the side lobes of stronger ones.

    Parameters
    ----------
    shaft_power : (n_lines, n_channels)
    lines
        The n lines asked for; by default all.

    Returns
    -------
    (n,)
    """
    leaked = leakage_kernel(shaft_power.shape[0])[lines] @ shaft_power
    own: npt.NDArray[np.bool_] = np.all(leaked <= MAX_LEAKAGE * shaft_power[lines], axis=1)
    return own


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
    spectrum: CrossSpectrum,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_segments: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean squared phasor of the probes' noise, known or from lines in the quiet band.

    What shaft and bearing have in common is motion and does not count; the rest is the probes'
    noise and, through the film, the bearing transducers'. Where those are quiet the estimate is
    true, else it is high.

    Parameters
    ----------
    n_segments
        Independent segments of the average; at least 3.

    Returns
    -------
    (2,) in µm², zero if no line is quiet; and their relative standard uncertainties, (2,).
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
