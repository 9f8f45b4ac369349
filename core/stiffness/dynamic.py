"""All eight coefficients of an oil film from what shakes the machine between its harmonics.

The force on the rotor does not enter ``(k_b - m_b ω² + iω c_b) V = (K + iω C) U`` (the bracket's
rows of Brito et al., equation 6), so hydraulic noise identifies the film. Runout lives on the
harmonics of the running speed, and these are left out.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.machine.unit import BracketDynamics
from core.quality import Reason
from core.spectra.cross_spectrum import (
    BEARING_X,
    SMEAR_BINS_SQUARED,
    CrossSpectrum,
    independent_segments,
    phasor_power_per_density,
)
from core.stiffness.dynamic_lines import (
    DynamicSettings,
    between_harmonics,
    little_leakage,
    probe_noise_power,
)
from core.stiffness.film_covariance import BracketChanges, FilmFit
from core.stiffness.film_fit import (
    coherence_segments,
    explained_share,
    lack_of_fit,
    line_weights,
    normal_equations,
    signal_share,
    smoother,
)

MAX_INERTIA_SHARE = 0.8
"""Largest mass that is sought takes so much of the bracket's stiffness away at the highest line."""

MAX_MASS_STD = 0.5
"""A mass that is not given must be found to that share of what a bracket may be thought to have;
else the lines do not determine it, and a film with it would be a guess."""


@dataclass(frozen=True)
class FilmChange:
    """Change of a film's coefficients per unit of something else.

    Parameters
    ----------
    k_n_per_m, c_n_s_per_m : (2, 2)
    """

    k_n_per_m: FloatArray
    c_n_s_per_m: FloatArray


@dataclass(frozen=True)
class DynamicStiffness:
    """Stiffness and damping of a film with what they rest on.

    Parameters
    ----------
    k_n_per_m, c_n_s_per_m : (2, 2)
        Rows are force directions, columns motion directions.
    covariance : (2, 4, 4)
        Random covariance of (k_i1, k_i2, c_i1, c_i2) for each row i.
    bracket_mass_kg, bracket_mass_std_kg
        Mass of the bracket that was used; its random standard uncertainty if it was fitted with the
        film, else 0.
    delay_s, delay_std_s
        What the bearing channels seem to be late by, whatever the bracket's mass, and its random
        standard uncertainty.
    per_stiffness, per_mass, per_damping, per_delay
        Changes per relative change of the bracket's stiffness, per kg of its mass, per N·s/m of its
        damping, and per second that the bearing channels are late.
    delay_per_damping
        Change of that delay per N·s/m of the bracket's damping.
    coherence : (2,)
        Multiple coherence of each bearing channel with the shaft's motion through the fitted film,
        over the used lines as they are weighted; 0 to 1.
    coherence_segments : (2,)
        Independent segments that would make that of a single line as certain.
    lack_of_fit : (2,)
        About 1 if the film is as constant over frequency as the model assumes, else more.
    frequency_hz : (n_used,)
        The lines that were used.
    probe_noise_um2_per_hz : (2,)
        One-sided density that was taken off the shaft spectra.
    noise_share
        Largest share of the shaft's weighted motion, over its directions, that it amounts to.
    """

    k_n_per_m: FloatArray
    c_n_s_per_m: FloatArray
    covariance: FloatArray
    bracket_mass_kg: float
    bracket_mass_std_kg: float
    delay_s: float
    delay_std_s: float
    per_stiffness: FilmChange
    per_mass: FilmChange
    per_damping: FilmChange
    per_delay: FilmChange
    delay_per_damping: float
    coherence: FloatArray
    coherence_segments: FloatArray
    lack_of_fit: FloatArray
    frequency_hz: FloatArray
    probe_noise_um2_per_hz: FloatArray
    noise_share: float
    n_segments: int

    @property
    def k_std_n_per_m(self) -> FloatArray:
        """Random standard uncertainty of the stiffnesses, (2, 2)."""
        std: FloatArray = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, :2])
        return std

    @property
    def c_std_n_s_per_m(self) -> FloatArray:
        """Random standard uncertainty of the damping coefficients, (2, 2)."""
        std: FloatArray = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, 2:])
        return std


def dynamic_stiffness(
    spectrum: CrossSpectrum,
    bracket: BracketDynamics,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_integrations: tuple[int, int] = (2, 2),
) -> DynamicStiffness | Reason:
    """Estimate a film's coefficients, or return the reason why that is not possible.

    A bracket whose mass is not known has it fitted with the film, one mass for both directions.

    Parameters
    ----------
    spectrum
        Of (u_x, u_y, v_x, v_y), averaged over segments in which all four were usable.
    turn_hz
        Lowest and highest 1× frequency measured in these segments.
    n_integrations
        From the measurands of v_x and v_y to displacement: 2 for acceleration, 1 for velocity, 0.
        At very high coherence the residual is what integration leaves; how its lines hang together
        decides the stated uncertainty, nothing else.

    Raises
    ------
    ValueError
        If the channels were averaged over different segments, or the speed is not positive.
    """
    n_averaged = int(spectrum.n_segments.max())
    if np.any(spectrum.n_segments != n_averaged):
        raise ValueError(f"channels averaged over different segments: {spectrum.n_segments}")
    if n_averaged < settings.min_segments:
        return Reason.FEW_SEGMENTS
    lines = _used_lines(spectrum, turn_hz, settings)
    if np.count_nonzero(lines) < settings.min_lines:
        return Reason.INSUFFICIENT_EXCITATION
    n_segments = independent_segments(n_averaged, settings.overlap)
    noise_power, floor_std = _noise_power(spectrum, turn_hz, settings, n_segments)
    index = np.flatnonzero(lines)
    smoothing = smoother(tuple(index.tolist()), settings.smoothing_reach_bins)
    smear_share = _smear_share(spectrum, lines, n_integrations)

    def fitted(bracket: BracketDynamics) -> FilmFit | None:
        stiffness = bracket.dynamic_stiffness_n_per_m(spectrum.frequency_hz[index])
        equations = normal_equations(spectrum, index, stiffness, noise_power)
        weight = line_weights(equations, spectrum.matrix[index], smoothing, settings.n_iterations)
        if weight is None:
            return None
        unknowns = equations.solve(weight, equations.force)
        return FilmFit(
            equations, weight, unknowns, index, smoothing, smear_share, n_segments, floor_std
        )

    fit = fitted(bracket)
    seeks_mass, max_mass_std_kg = bracket.mass_kg is None, MAX_MASS_STD * bracket.max_mass_kg
    for _ in range(settings.n_iterations if seeks_mass else 0):
        heavier = None if fit is None else _with_mass(bracket, fit)
        if heavier is None:
            return Reason.INSUFFICIENT_EXCITATION
        bracket, fit = heavier, fitted(heavier)
    if fit is None:
        return Reason.INSUFFICIENT_EXCITATION
    found = _result(spectrum, bracket, fit, n_averaged, seeks_mass=seeks_mass)
    convinces = _convinces(found, settings) and not found.bracket_mass_std_kg > max_mass_std_kg
    return found if convinces else Reason.INSUFFICIENT_EXCITATION


STIFFNESS, MASS, DAMPING, DELAY = range(4)
"""Changes of the bracket's dynamic stiffness: relative, per kg, per N·s/m, per s of delay."""


def _bracket_changes(bracket: BracketDynamics, fit: FilmFit) -> BracketChanges:
    omega = fit.equations.ratio * fit.equations.omega_unit
    changes = np.zeros((4, omega.size), dtype=np.complex128)
    changes[STIFFNESS] = bracket.stiffness_n_per_m
    changes[MASS] = -(omega**2)
    changes[DAMPING] = 1j * omega
    # what is read late has turned back by ω times the delay
    changes[DELAY] = 1j * omega * fit.equations.bracket_n_per_m
    return BracketChanges(fit, changes)


def _with_mass(bracket: BracketDynamics, fit: FilmFit) -> BracketDynamics | None:
    """The bracket with the mass that the film's residual asks for; None if it asks for none."""
    found = _bracket_changes(bracket, fit).estimate([MASS])
    if found is None:
        return None
    highest = float(fit.equations.ratio[-1]) * fit.equations.omega_unit
    limit_kg = MAX_INERTIA_SHARE * bracket.stiffness_n_per_m / highest**2
    mass_kg = (bracket.mass_kg or 0.0) + float(found.value[0])
    return replace(bracket, mass_kg=min(max(mass_kg, -limit_kg), limit_kg))


def _used_lines(
    spectrum: CrossSpectrum, turn_hz: tuple[float, float], settings: DynamicSettings
) -> npt.NDArray[np.bool_]:
    """Lines of the band that carry the shaft's own broadband motion and some bearing motion."""
    power = np.diagonal(spectrum.matrix, axis1=1, axis2=2).real
    selection = settings.selection
    used: npt.NDArray[np.bool_] = (
        _inside(spectrum.frequency_hz, settings.band_hz)
        & between_harmonics(spectrum.frequency_hz, turn_hz, selection.guard_bins)
        & np.all(power > 0.0, axis=1)
    )
    inside = np.flatnonzero(used)
    if inside.size:
        band = slice(int(inside[0]), int(inside[-1]) + 1)
        used[band] &= little_leakage(power[:, :BEARING_X], selection.max_leakage, band)
    return used


def _noise_power(
    spectrum: CrossSpectrum,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_segments: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean squared phasor of each probe's noise, and their relative standard uncertainties."""
    bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    if settings.probe_noise_um2_per_hz is not None:
        known = phasor_power_per_density(bin_hz) * np.array(settings.probe_noise_um2_per_hz)
        return known, np.zeros(2)
    quiet = _inside(spectrum.frequency_hz, settings.quiet_band_hz)
    guard_bins = settings.selection.guard_bins
    quiet &= between_harmonics(spectrum.frequency_hz, turn_hz, guard_bins)
    return probe_noise_power(spectrum, quiet, n_segments)


def _inside(frequency_hz: FloatArray, band_hz: tuple[float, float]) -> npt.NDArray[np.bool_]:
    return (frequency_hz >= band_hz[0]) & (frequency_hz <= band_hz[1])


def _result(
    spectrum: CrossSpectrum,
    bracket: BracketDynamics,
    fit: FilmFit,
    n_averaged: int,
    *,
    seeks_mass: bool,
) -> DynamicStiffness:
    equations, weight, unknowns = fit.equations, fit.weight, fit.unknowns
    changes = _bracket_changes(bracket, fit)
    mass = changes.estimate([MASS]) if seeks_mass else None
    with_delay = [DELAY, MASS]
    delay = changes.estimate(with_delay)
    scale = np.array([1.0, 1.0, 1.0 / equations.omega_unit, 1.0 / equations.omega_unit])
    covariance = fit.covariance() if mass is None else mass.with_film(fit)

    def per(change: int) -> FilmChange:
        """Change of the film, with that of the mass if it is fitted."""
        found = changes.per[change]
        if mass is not None and change != MASS:
            found = found + float(changes.follow(change, [MASS])[0]) * changes.per[MASS]
        return FilmChange(found[:, :2], found[:, 2:] / equations.omega_unit)

    bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    return DynamicStiffness(
        k_n_per_m=unknowns[:, :2],
        c_n_s_per_m=unknowns[:, 2:] / equations.omega_unit,
        covariance=covariance * np.outer(scale, scale),
        bracket_mass_kg=bracket.mass_kg or 0.0,
        bracket_mass_std_kg=0.0 if mass is None else float(mass.std[0]),
        delay_s=0.0 if delay is None else float(delay.value[0]),
        delay_std_s=math.inf if delay is None else float(delay.std[0]),
        per_stiffness=per(STIFFNESS),
        per_mass=per(MASS),
        per_damping=per(DAMPING),
        per_delay=per(DELAY),
        delay_per_damping=0.0 if delay is None else float(changes.follow(DAMPING, with_delay)[0]),
        coherence=explained_share(weight, fit.residual, equations.force_power),
        coherence_segments=coherence_segments(
            weight, fit.residual, equations.force_power, fit.smoothing, fit.n_segments
        ),
        lack_of_fit=lack_of_fit(equations, unknowns, weight, fit.n_segments),
        frequency_hz=spectrum.frequency_hz[fit.lines],
        probe_noise_um2_per_hz=equations.noise_power / phasor_power_per_density(bin_hz),
        noise_share=1.0 - signal_share(equations, weight),
        n_segments=n_averaged,
    )


def _smear_share(
    spectrum: CrossSpectrum, lines: npt.NDArray[np.bool_], n_integrations: tuple[int, int]
) -> FloatArray:
    """Share of each bearing's line that is integrated with a wrong frequency, (n_used, 2)."""
    bin_hz = spectrum.frequency_hz[1] - spectrum.frequency_hz[0]
    slope = np.array(n_integrations) * bin_hz / spectrum.frequency_hz[lines, np.newaxis]
    share: FloatArray = SMEAR_BINS_SQUARED * slope**2
    return share


def _convinces(found: DynamicStiffness, settings: DynamicSettings) -> bool:
    if 1.0 - found.noise_share < settings.min_signal_share:
        return False
    largest = float(np.abs(np.diag(found.k_n_per_m)).max())
    uncertain = bool(
        np.any(np.diag(found.k_std_n_per_m) > settings.max_relative_uncertainty * largest)
    )
    return not uncertain and bool(np.all(found.coherence >= settings.min_coherence))
