"""All eight coefficients of an oil film from broadband vibration between the harmonics.

The force on the rotor does not enter ``(k_b - m_b ω² + iω c_b) V = (K + iω C) U`` (the bracket's
rows of Brito et al., equation 6), so hydraulic noise identifies the film. The harmonics of the
running speed contain runout and are left out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import BoolArray, FloatArray
from core.machine.unit import BracketDynamics
from core.quality import Reason
from core.spectra.cross_spectrum import (
    SMEAR_BINS_SQUARED,
    CrossSpectrum,
    independent_segments,
    phasor_power_per_density,
)
from core.stiffness.dynamic_lines import (
    DynamicSettings,
    between_harmonics,
    probe_noise_power,
    used_lines,
)
from core.stiffness.film_covariance import LAGS, FilmFits
from core.stiffness.film_fit import N_ITERATIONS, FilmLines, WeightedTerms, line_weights
from core.stiffness.fitted_films import (
    DAMPING,
    DELAY,
    MASS,
    N_LAGS,
    N_PARTS,
    STIFFNESS,
    FilmInputs,
)

MIN_LINES = 12
"""Smallest number of usable lines for a result."""

MAX_INERTIA_SHARE = 0.8
"""Limit of a fitted mass: largest ratio of the bracket's inertia force to its spring force at the
highest line."""

MAX_MASS_STD = 0.5
"""Largest standard uncertainty of a fitted mass as a fraction of the largest plausible mass of the
bracket. Beyond it the lines do not determine the mass, and there is no result."""

CONSTANT_ODDS = 3e-5
"""Prior odds of a film that is constant over frequency. Films of fixed pads are, and those of
tilting pads nearly so at some positions of the shaft."""

DELAY_DOUBTFUL, DELAY_CERTAIN = 9.5, 18.5
"""Squared significance of a delay of the bearing channels up to which it is none, and from which
it may explain a misfit."""

LAG_RESOLUTION = 0.001
"""Standard uncertainty of damping beside lagging parts from tapering, as in `dynamic_readings`:
errors are 0.10 to 0.16 % in simulations without noise."""

AS_DELAY, AS_LAGS = 1.0, 1.1
"""Ratios of the squared significances of lagging parts and of a significant delay of the bearing
channels, up to which the misfit is a delay, and from which it is the film. Medians are 1.4 to 1.7
for films of tilting pads and 0.7 to 0.85 for late channels."""


@dataclass(frozen=True)
class DynamicStiffness:
    """Stiffness and damping of a film, with statistics of the fit.

    Parameters
    ----------
    coefficients : (2, 4)
        Coefficients (k_i1, k_i2, c_i1, c_i2) of the rows x and y, the directions of the force; N/m
        and N·s/m. They apply at 1× if the film depends on frequency.
    covariance : (2, 4, 4)
        Covariance of the random errors of the coefficients of each row.
    model : (2, 4)
        Half-widths of the uniform systematic errors of the coefficients, due to a film that
        depends on frequency.
    changes : (4, 2, 4)
        Change of the coefficients per unit of relative stiffness, mass in kg and damping in N·s/m
        of the bracket, and delay of the bearing channels in s.
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
    late_share
        Share of the misfit of constant coefficients that a delay explains better than the film.
    coherence : (2,)
        Fraction of the power of each bearing channel that the shaft's motion explains through the
        fitted film, over the weighted lines; 0 to 1.
    coherence_segments : (2,)
        Number of independent segments that would make a coherence at a single line equally certain.
    lack_of_fit : (2,)
        About 1 if stiffness and damping are constant over the lines; otherwise larger.
    frequency_hz : (n_used,)
        Frequencies of the used lines.
    probe_noise_um2_per_hz : (2,)
        One-sided noise density subtracted from the shaft spectra.
    noise_share
        Noise power as a fraction of the shaft's weighted power, in the worst direction.
    """

    coefficients: FloatArray
    covariance: FloatArray
    model: FloatArray
    changes: FloatArray
    bracket_mass_kg: float
    bracket_mass_std_kg: float
    delay_s: float
    delay_std_s: float
    delay_per_damping: float
    late_share: float
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
    def std(self) -> FloatArray:
        """Random standard uncertainties of the coefficients, (2, 4)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


@dataclass(frozen=True)
class FilmSpectrum:
    """Measured spectrum of one bearing, to which a film is fitted.

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
    """

    spectrum: CrossSpectrum
    bracket: BracketDynamics
    turn_hz: tuple[float, float]
    n_integrations: tuple[int, int] = (2, 2)


def films(
    measured: Sequence[FilmSpectrum], settings: DynamicSettings
) -> list[DynamicStiffness | Reason]:
    """Return the films' coefficients fitted to spectra, or the reasons why there is no result.

    The bearings of a unit are fitted in common arrays; their results do not depend on each other.
    An unknown mass of a bracket is fitted with the film, one mass for both directions.
    """
    found: list[DynamicStiffness | Reason] = [Reason.FEW_SEGMENTS] * len(measured)
    alike: dict[tuple[float, float], list[int]] = {}
    for place, each in enumerate(measured):
        if each.spectrum.n_segments[0, 0] >= settings.min_segments:
            alike.setdefault(each.turn_hz, []).append(place)
    for places in alike.values():
        with np.errstate(divide="ignore", invalid="ignore"):  # of bearings without a result
            fitted = _fitted([measured[place] for place in places], settings)
        for place, result in zip(places, fitted, strict=True):
            found[place] = Reason.INSUFFICIENT_EXCITATION
            if result is not None and _convinces(result, measured[place].bracket, settings):
                found[place] = result
    return found


def _fitted(
    measured: Sequence[FilmSpectrum], settings: DynamicSettings
) -> list[DynamicStiffness | None]:
    """Return the fitted film of each bearing, or None; all have the same range of speed."""
    spectra, turn_hz = [each.spectrum for each in measured], measured[0].turn_hz
    frequency_hz = spectra[0].frequency_hz
    between = between_harmonics(frequency_hz, turn_hz, settings.guard_bins)
    used = used_lines(spectra, between, settings)
    enough = [own.size >= MIN_LINES for own in used]
    if not all(enough):
        some = [each for each, kept in zip(measured, enough, strict=True) if kept]
        films_found = iter(_fitted(some, settings) if some else [])
        return [next(films_found) if kept else None for kept in enough]
    n_segments = np.array(
        [[independent_segments(int(s.n_segments[0, 0]), settings.overlap)] for s in spectra]
    )
    noise_power, floor_std = probe_noise_power(spectra, between, settings, n_segments)
    brackets = [each.bracket for each in measured]
    bin_hz = float(frequency_hz[1] - frequency_hz[0])
    lines = FilmLines([spectrum.matrix for spectrum in spectra], used, frequency_hz, noise_power)
    # error of each bearing line from integration with the line's frequency
    slope = np.array([each.n_integrations for each in measured])[..., np.newaxis] * bin_hz
    smear_share = SMEAR_BINS_SQUARED * (slope / lines.frequency_hz[:, np.newaxis]) ** 2
    stiffness = np.array([[bracket.stiffness_n_per_m] for bracket in brackets])
    damping = np.array([[bracket.damping_n_s_per_m] for bracket in brackets])
    mass_kg = np.array([[bracket.mass_kg or 0.0] for bracket in brackets])
    seeks = np.array([bracket.mass_kg is None for bracket in brackets])
    omega = lines.omega
    changes = np.empty((len(measured), 4, omega.shape[1]), dtype=np.complex128)
    changes[:, STIFFNESS], changes[:, MASS] = stiffness, -(omega**2)
    changes[:, DAMPING] = 1j * omega
    moves = np.ones(len(measured), dtype=np.bool_)
    turn_rad_s = math.pi * sum(turn_hz)
    no_parts, no_share = np.zeros((len(measured), 2, N_PARTS)), np.zeros((len(measured), 1))

    def fit() -> tuple[FilmFits, BoolArray]:
        bracket_n_per_m = stiffness - mass_kg * omega**2 + 1j * omega * damping
        # a delay turns the phase back by ω times the delay
        changes[:, DELAY] = 1j * omega * bracket_n_per_m
        errors = smear_share, n_segments, floor_std
        inputs = FilmInputs(lines, bracket_n_per_m, changes.copy(), *errors, turn_rad_s)
        terms = inputs.terms(no_share)
        weight, moving = line_weights(terms, inputs.force_power)
        found = FilmFits(inputs, WeightedTerms(terms, weight), no_parts, no_share)
        return found, moves & moving

    found, moves = fit()
    limit_kg = MAX_INERTIA_SHARE * stiffness / omega[:, -1:] ** 2
    for _ in range(N_ITERATIONS if seeks.any() else 0):
        heavier = mass_kg + found.estimate([MASS])[0]
        moves &= ~(seeks & np.isnan(heavier[:, 0]))
        heavier = np.minimum(np.maximum(heavier, -limit_kg), limit_kg)
        mass_kg = np.where((seeks & moves)[:, np.newaxis], heavier, mass_kg)
        found, moves = fit()
    if not moves.any():
        return [None] * len(measured)
    is_late, odds = late_share(found), found.constant_odds()
    dropped = np.where(seeks | ~moves, 1.0, is_late)[:, np.newaxis]
    kept = np.nan_to_num((1.0 - dropped) / (1.0 + CONSTANT_ODDS * odds[:, np.newaxis]))
    lagging = found.with_parts(kept, N_LAGS)
    delay = _delay(lagging, is_late > 0.0)
    fits = lagging.with_parts(kept, N_PARTS)
    results = _results(fits, dropped, delay, mass_kg[:, 0], seeks, bin_hz)
    return [
        result if moving else None for result, moving in zip(results, moves.tolist(), strict=True)
    ]


def late_share(fits: FilmFits) -> FloatArray:
    """Return the share of the misfit that a delay of the bearing channels explains, (n,), 0 to 1.

    The share is continuous, so that results do not jump between averages.
    """
    lags, delay = fits.lag_significance, fits.delay_significance()
    certain = np.clip((delay - DELAY_DOUBTFUL) / (DELAY_CERTAIN - DELAY_DOUBTFUL), 0.0, 1.0)
    is_delay = 1.0 - np.clip((lags / delay - AS_DELAY) / (AS_LAGS - AS_DELAY), 0.0, 1.0)
    return np.nan_to_num(certain * is_delay)


def _delay(fits: FilmFits, may_be_late: BoolArray) -> FloatArray:
    """Return the delay of the bearing channels, its uncertainty and per `DAMPING`, (3, n).

    Where a delay is not excluded it is beside a film of constant coefficients, otherwise beside
    lagging parts with the lag of the prior: a fitted lag would take up the delay.
    """
    share = fits.kept[:, 0]
    constant, lagging = fits.delays(([DELAY, MASS], [DELAY, MASS, *LAGS]))
    mixed: FloatArray = (1.0 - share) * constant + share * lagging
    return np.where((share > 0.0) & ~may_be_late, mixed, constant)


def _results(
    fits: FilmFits,
    dropped: FloatArray,
    delay: FloatArray,
    mass_kg: FloatArray,
    seeks_mass: BoolArray,
    bin_hz: float,
) -> list[DynamicStiffness]:
    delay_s, delay_std, delay_per_damping = delay
    tapered = np.zeros_like(fits.unknowns)
    damping = LAG_RESOLUTION * fits.kept * np.einsum("nrr->nr", fits.unknowns[:, :, 2:])
    tapered[..., 2:] = damping[..., np.newaxis]
    of_doubt, left = fits.parts_left(dropped)
    variance = np.maximum(np.einsum("nruu->nru", left), 0.0) + tapered**2
    model = np.sqrt(3.0 * variance)
    covariance = fits.film_covariance() + of_doubt
    mass_std_kg, whole = np.zeros(len(mass_kg)), np.zeros(len(mass_kg), dtype=np.bool_)
    if seeks_mass.any():
        masses_kg, of_mass = fits.estimate([MASS])
        whole = seeks_mass & ~np.isnan(masses_kg[:, 0])
        std = np.sqrt(fits.covariance(of_mass)[:, 0, 0])
        mass_std_kg = np.where(whole, std, 0.0)
        covariance[whole] = fits.film_covariance_with([MASS])[whole]
    # what is fitted follows a change of what is not
    per = fits.per_change_with_parts()
    for change in (STIFFNESS, DAMPING, DELAY) if whole.any() else ():
        follows = np.where(whole[:, np.newaxis], fits.follow(change, [MASS]), 0.0)
        per[..., change] += follows[..., np.newaxis] * fits.per_change[..., MASS]
    per = per.transpose(0, 3, 1, 2)
    lines = fits.inputs.lines
    scale = (lines.omega_unit ** (0.0, 0.0, 1.0, 1.0))[:, np.newaxis]
    coefficients = fits.unknowns / scale
    covariance /= scale[..., np.newaxis] * scale[..., np.newaxis, :]
    model, per = model / scale, per / scale[:, np.newaxis]
    coherence, segments, lack = fits.coherence, fits.coherence_segments, fits.lack_of_fit
    noise_um2_per_hz = lines.noise_power / phasor_power_per_density(bin_hz)
    signal_share = fits.weighted.signal_share
    unseparable = np.isnan(delay_s)
    sizes = lines.counted.sum(axis=(1, 2)).astype(int).tolist()
    return [
        DynamicStiffness(
            coefficients=coefficients[n],
            covariance=covariance[n],
            model=model[n],
            changes=per[n],
            bracket_mass_kg=float(mass_kg[n]),
            bracket_mass_std_kg=float(mass_std_kg[n]),
            delay_s=0.0 if unseparable[n] else float(delay_s[n]),
            delay_std_s=math.inf if unseparable[n] else float(delay_std[n]),
            delay_per_damping=0.0 if unseparable[n] else float(delay_per_damping[n]),
            late_share=0.0 if seeks_mass[n] else float(dropped[n, 0]),
            coherence=coherence[n],
            coherence_segments=segments[n],
            lack_of_fit=lack[n],
            frequency_hz=lines.frequency_hz[n, :size],
            probe_noise_um2_per_hz=noise_um2_per_hz[n],
            noise_share=1.0 - float(signal_share[n]),
        )
        for n, size in enumerate(sizes)
    ]


def _convinces(
    found: DynamicStiffness, bracket: BracketDynamics, settings: DynamicSettings
) -> bool:
    if found.bracket_mass_std_kg > MAX_MASS_STD * bracket.max_mass_kg:
        return False
    if 1.0 - found.noise_share < settings.min_signal_share:
        return False
    largest = float(np.abs(np.diag(found.k_n_per_m)).max())
    uncertain = bool(np.any(np.diag(found.std) > settings.max_relative_uncertainty * largest))
    return not uncertain and bool(np.all(found.coherence >= settings.min_coherence))
