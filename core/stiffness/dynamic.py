"""All eight coefficients of an oil film from broadband vibration between the harmonics.

The force on the rotor does not enter ``(k_b - m_b ω² + iω c_b) V = (K + iω C) U`` (the bracket's
rows of Brito et al., equation 6), so hydraulic noise identifies the film. The harmonics of the
running speed contain runout and are left out.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from core.arrays import FloatArray
from core.machine.unit import BracketDynamics
from core.quality import Reason
from core.spectra.cross_spectrum import (
    SMEAR_BINS_SQUARED,
    CrossSpectrum,
    independent_segments,
    phasor_power_per_density,
)
from core.stiffness.dynamic_lines import DynamicSettings, probe_noise_power, used_lines
from core.stiffness.film_covariance import EACH_ROW, BracketChanges, FilmFit
from core.stiffness.film_fit import N_ITERATIONS, NormalEquations, line_weights, smoother

MIN_LINES = 12
"""Smallest number of usable lines for a result."""

MAX_INERTIA_SHARE = 0.8
"""Limit of a fitted mass: largest ratio of the bracket's inertia force to its spring force at the
highest line."""

MAX_MASS_STD = 0.5
"""Largest standard uncertainty of a fitted mass as a fraction of the largest plausible mass of the
bracket. Beyond it the lines do not determine the mass, and there is no result."""

STIFFNESS, MASS, DAMPING, DELAY = range(4)
"""Indices of the bracket properties that can change: relative stiffness, mass in kg, damping in
N·s/m, and delay of the bearing channels in s."""


@dataclass(frozen=True)
class DynamicStiffness:
    """Stiffness and damping of a film, with statistics of the fit.

    Parameters
    ----------
    coefficients : (2, 4)
        Coefficients (k_i1, k_i2, c_i1, c_i2) of the rows x and y, the directions of the force; N/m
        and N·s/m.
    covariance : (2, 4, 4)
        Random covariance of the coefficients of each row.
    changes : (4, 2, 4)
        Change of the coefficients per unit of `STIFFNESS`, `MASS`, `DAMPING` and `DELAY`.
    bracket_mass_kg
        Mass of the bracket, given or fitted together with the film.
    bracket_mass_std_kg
        Random standard uncertainty of a fitted mass; 0 for a given mass.
    delay_s
        Apparent delay of the bearing channels, fitted together with the bracket's mass.
    delay_std_s
        Random standard uncertainty of `delay_s`; infinite if the delay could not be fitted.
    delay_per_damping
        Change of `delay_s` per N·s/m of the bracket's damping.
    coherence : (2,)
        Fraction of the power of each bearing channel that the shaft's motion explains through the
        fitted film, over the weighted lines; 0 to 1.
    coherence_segments : (2,)
        Number of independent segments that would make a coherence at a single line equally certain.
    lack_of_fit : (2,)
        About 1 if stiffness and damping are constant over frequency, as modelled; else larger.
    frequency_hz : (n_used,)
        Frequencies of the used lines.
    probe_noise_um2_per_hz : (2,)
        One-sided noise density subtracted from the shaft spectra.
    noise_share
        Noise power as a fraction of the shaft's weighted power, in the worst direction.
    """

    coefficients: FloatArray
    covariance: FloatArray
    changes: FloatArray
    bracket_mass_kg: float
    bracket_mass_std_kg: float
    delay_s: float
    delay_std_s: float
    delay_per_damping: float
    coherence: FloatArray
    coherence_segments: FloatArray
    lack_of_fit: FloatArray
    frequency_hz: FloatArray
    probe_noise_um2_per_hz: FloatArray
    noise_share: float

    @property
    def k_n_per_m(self) -> FloatArray:
        """Stiffnesses, (2, 2); rows are force directions, columns motion directions."""
        return self.coefficients[:, :2]

    @property
    def c_n_s_per_m(self) -> FloatArray:
        """Damping coefficients, (2, 2); rows and columns as for `k_n_per_m`."""
        return self.coefficients[:, 2:]

    @property
    def std(self) -> FloatArray:
        """Random standard uncertainties of the coefficients, (2, 4)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def dynamic_stiffness(
    spectrum: CrossSpectrum,
    bracket: BracketDynamics,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_integrations: tuple[int, int] = (2, 2),
) -> DynamicStiffness | Reason:
    """Return a film's coefficients fitted to a spectrum, or the reason why there is no result.

    An unknown mass of the bracket is fitted with the film, one mass for both directions.

    Parameters
    ----------
    spectrum
        Cross-spectrum of (u_x, u_y, v_x, v_y), averaged over segments in which all four are usable.
    turn_hz
        Lowest and highest 1× frequency measured in these segments.
    n_integrations
        Number of integrations of v_x and v_y to displacement: 2 for acceleration, 1 for velocity,
        0 for displacement. At very high coherence the residual is the integration error; the number
        affects only the stated uncertainty.

    Raises
    ------
    ValueError
        If the channels were averaged over different segments, or the speed is not positive.
    """
    n_averaged = int(spectrum.n_segments.max())
    if np.any(spectrum.n_segments != n_averaged):
        raise ValueError(f"channels must have the same segments, got {spectrum.n_segments}")
    if n_averaged < settings.min_segments:
        return Reason.FEW_SEGMENTS
    lines = used_lines(spectrum, turn_hz, settings)
    if lines.size < MIN_LINES:
        return Reason.INSUFFICIENT_EXCITATION
    n_segments = independent_segments(n_averaged, settings.overlap)
    noise_power, floor_std = probe_noise_power(spectrum, turn_hz, settings, n_segments)
    frequency_hz, matrix = spectrum.frequency_hz[lines], spectrum.matrix[lines]
    smoothing = smoother(tuple(lines.tolist()))
    bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    # error of each bearing line from integration with the line's frequency
    slope = np.array(n_integrations) * bin_hz / frequency_hz[:, np.newaxis]
    smear_share = SMEAR_BINS_SQUARED * slope**2

    def fitted(bracket: BracketDynamics) -> FilmFit | None:
        stiffness = bracket.dynamic_stiffness_n_per_m(frequency_hz)
        equations = NormalEquations(matrix, 2.0 * np.pi * frequency_hz, stiffness, noise_power)
        weight = line_weights(equations, smoothing)
        if weight is None:
            return None
        return FilmFit(equations, weight, lines, smoothing, smear_share, n_segments, floor_std)

    fit = fitted(bracket)
    seeks_mass, max_mass_std_kg = bracket.mass_kg is None, MAX_MASS_STD * bracket.max_mass_kg
    for _ in range(N_ITERATIONS if seeks_mass else 0):
        heavier = None if fit is None else _with_mass(bracket, fit)
        if heavier is None:
            return Reason.INSUFFICIENT_EXCITATION
        bracket, fit = heavier, fitted(heavier)
    if fit is None:
        return Reason.INSUFFICIENT_EXCITATION
    noise_um2_per_hz = noise_power / phasor_power_per_density(bin_hz)
    found = _result(bracket, fit, frequency_hz, noise_um2_per_hz, seeks_mass=seeks_mass)
    convinces = _convinces(found, settings) and not found.bracket_mass_std_kg > max_mass_std_kg
    return found if convinces else Reason.INSUFFICIENT_EXCITATION


def _bracket_changes(bracket: BracketDynamics, fit: FilmFit) -> BracketChanges:
    omega = fit.equations.ratio * fit.equations.omega_unit
    changes = np.zeros((4, omega.size), dtype=np.complex128)
    changes[STIFFNESS] = bracket.stiffness_n_per_m
    changes[MASS] = -(omega**2)
    changes[DAMPING] = 1j * omega
    # a delay turns the phase back by ω times the delay
    changes[DELAY] = 1j * omega * fit.equations.bracket_n_per_m
    return BracketChanges(fit, changes)


def _with_mass(bracket: BracketDynamics, fit: FilmFit) -> BracketDynamics | None:
    """Return the bracket with a mass fitted to the residual force; None if it cannot be fitted."""
    found = _bracket_changes(bracket, fit).estimate([MASS])
    if found is None:
        return None
    highest = float(fit.equations.ratio[-1]) * fit.equations.omega_unit
    limit_kg = MAX_INERTIA_SHARE * bracket.stiffness_n_per_m / highest**2
    mass_kg = (bracket.mass_kg or 0.0) + float(found.value[0])
    return replace(bracket, mass_kg=min(max(mass_kg, -limit_kg), limit_kg))


def _result(
    bracket: BracketDynamics,
    fit: FilmFit,
    frequency_hz: FloatArray,
    noise_um2_per_hz: FloatArray,
    *,
    seeks_mass: bool,
) -> DynamicStiffness:
    changes = _bracket_changes(bracket, fit)
    mass = changes.estimate([MASS]) if seeks_mass else None
    delay = changes.estimate([DELAY, MASS])
    per = changes.per.copy()
    if mass is None:
        covariance = fit.spread(fit.own_influences[:, np.newaxis], EACH_ROW)
    else:
        covariance = changes.film_covariance([MASS], mass.influences)
        for change in (STIFFNESS, DAMPING, DELAY):  # the fitted mass follows
            per[change] += float(changes.follow(change, [MASS])[0]) * changes.per[MASS]
    omega_unit = fit.equations.omega_unit
    scale = np.array([1.0, 1.0, omega_unit, omega_unit])
    return DynamicStiffness(
        coefficients=fit.unknowns / scale,
        covariance=covariance * np.outer(1.0 / scale, 1.0 / scale),
        changes=per / scale,
        bracket_mass_kg=bracket.mass_kg or 0.0,
        bracket_mass_std_kg=0.0 if mass is None else float(mass.std[0]),
        delay_s=0.0 if delay is None else float(delay.value[0]),
        delay_std_s=math.inf if delay is None else float(delay.std[0]),
        delay_per_damping=(
            0.0 if delay is None else float(changes.follow(DAMPING, [DELAY, MASS])[0])
        ),
        coherence=fit.coherence,
        coherence_segments=fit.coherence_segments,
        lack_of_fit=fit.lack_of_fit,
        frequency_hz=frequency_hz,
        probe_noise_um2_per_hz=noise_um2_per_hz,
        noise_share=1.0 - fit.equations.signal_share(fit.weight),
    )


def _convinces(found: DynamicStiffness, settings: DynamicSettings) -> bool:
    if 1.0 - found.noise_share < settings.min_signal_share:
        return False
    largest = float(np.abs(np.diag(found.k_n_per_m)).max())
    uncertain = bool(np.any(np.diag(found.std) > settings.max_relative_uncertainty * largest))
    return not uncertain and bool(np.all(found.coherence >= settings.min_coherence))
