"""All eight coefficients of an oil film from what shakes the machine between its harmonics.

The force on the rotor does not enter ``(k_b - m_b ω² + iω c_b) V = (K + iω C) U`` (the bracket's
rows of Brito et al., equation 6), so hydraulic noise identifies the film. Runout lives on the
harmonics of the running speed, and these are left out.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.bracket import BracketDynamics
from core.cross_spectrum import BEARING_X, CrossSpectrum
from core.dynamic_settings import DynamicSettings
from core.film_fit import (
    explained_share,
    film_phase,
    inflation_of,
    lack_of_fit,
    line_weights,
    signal_share,
    smoother,
)
from core.normal_equations import NormalEquations, normal_equations
from core.probe_noise import probe_noise_power
from core.quality import Reason
from core.spectral_statistics import (
    SMEAR_BINS_SQUARED,
    independent_segments,
    phasor_power_per_density,
)
from core.usable_lines import between_harmonics, little_leakage


@dataclass(frozen=True)
class DynamicStiffness:
    """Stiffness and damping of a film with what they rest on.

    Parameters
    ----------
    k_n_per_m, c_n_s_per_m : (2, 2)
        Rows are force directions, columns motion directions.
    covariance : (2, 4, 4)
        Random covariance of (k_i1, k_i2, c_i1, c_i2) for each row i.
    k_per_bracket_n_per_m, c_per_bracket_n_s_per_m : (2, 2)
        Change per relative change of the bracket's stiffness.
    coherence : (2,)
        Multiple coherence of each bearing channel with the shaft's motion through the fitted film,
        over the used lines as they are weighted; 0 to 1.
    lack_of_fit : (2,)
        About 1 if the film is as constant over frequency as the model says, else more.
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
    k_per_bracket_n_per_m: FloatArray
    c_per_bracket_n_s_per_m: FloatArray
    coherence: FloatArray
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
) -> DynamicStiffness | Reason:
    """Estimate a film's coefficients, or say why that is not possible.

    Parameters
    ----------
    spectrum
        Of (u_x, u_y, v_x, v_y), averaged over segments in which all four were usable.
    turn_hz
        Lowest and highest 1× frequency measured in these segments.

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
    noise_power = _noise_power(spectrum, turn_hz, settings, n_segments)
    index = np.flatnonzero(lines)
    stiffness = bracket.dynamic_stiffness_n_per_m(spectrum.frequency_hz[index])
    equations = normal_equations(spectrum, index, stiffness, noise_power)
    smoothing = smoother(tuple(index.tolist()), settings.smoothing_reach_bins)
    weight = line_weights(equations, spectrum.matrix[index], smoothing, settings.n_iterations)
    if weight is None:
        return Reason.INSUFFICIENT_EXCITATION
    found = _result(spectrum, lines, bracket, equations, weight, noise_power, settings)
    return found if _convinces(found, settings) else Reason.INSUFFICIENT_EXCITATION


def _used_lines(
    spectrum: CrossSpectrum, turn_hz: tuple[float, float], settings: DynamicSettings
) -> npt.NDArray[np.bool_]:
    """Lines of the band that carry the shaft's own broadband motion and some bearing motion."""
    power = np.diagonal(spectrum.matrix, axis1=1, axis2=2).real
    selection = settings.selection
    used: npt.NDArray[np.bool_] = (
        _inside(spectrum.frequency_hz, settings.band_hz)
        & between_harmonics(spectrum.frequency_hz, turn_hz, selection.guard_bins)
        & little_leakage(power[:, :BEARING_X], selection.max_leakage)
        & np.all(power > 0.0, axis=1)
    )
    return used


def _noise_power(
    spectrum: CrossSpectrum,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_segments: float,
) -> FloatArray:
    bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    if settings.probe_noise_um2_per_hz is not None:
        return phasor_power_per_density(bin_hz) * np.array(settings.probe_noise_um2_per_hz)
    quiet = _inside(spectrum.frequency_hz, settings.quiet_band_hz)
    guard_bins = settings.selection.guard_bins
    quiet &= between_harmonics(spectrum.frequency_hz, turn_hz, guard_bins)
    return probe_noise_power(spectrum, quiet, n_segments)


def _inside(frequency_hz: FloatArray, band_hz: tuple[float, float]) -> npt.NDArray[np.bool_]:
    return (frequency_hz >= band_hz[0]) & (frequency_hz <= band_hz[1])


def _result(
    spectrum: CrossSpectrum,
    lines: npt.NDArray[np.bool_],
    bracket: BracketDynamics,
    equations: NormalEquations,
    weight: FloatArray,
    noise_power: FloatArray,
    settings: DynamicSettings,
) -> DynamicStiffness:
    n_averaged = int(spectrum.n_segments.max())
    n_segments = independent_segments(n_averaged, settings.overlap)
    unknowns = equations.solve(weight, equations.force)
    per_bracket = bracket.stiffness_n_per_m * equations.solve(weight, equations.spring)
    residual = equations.residual(unknowns)
    smear = equations.force_power * _smear_share(spectrum, lines, settings.n_integrations)
    part = np.minimum(np.divide(smear, residual, out=np.ones_like(smear), where=residual > 0), 1.0)
    inflation = inflation_of(lines, part, film_phase(equations, unknowns))
    scale = np.array([1.0, 1.0, 1.0 / equations.omega_unit, 1.0 / equations.omega_unit])
    covariance = equations.covariance(weight, residual, inflation, n_segments)
    bin_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    return DynamicStiffness(
        k_n_per_m=unknowns[:, :2],
        c_n_s_per_m=unknowns[:, 2:] / equations.omega_unit,
        covariance=covariance * np.outer(scale, scale),
        k_per_bracket_n_per_m=per_bracket[:, :2],
        c_per_bracket_n_s_per_m=per_bracket[:, 2:] / equations.omega_unit,
        coherence=explained_share(weight, residual, equations.force_power),
        lack_of_fit=lack_of_fit(equations, unknowns, weight, n_segments),
        frequency_hz=spectrum.frequency_hz[lines],
        probe_noise_um2_per_hz=noise_power / phasor_power_per_density(bin_hz),
        noise_share=1.0 - signal_share(equations, weight),
        n_segments=n_averaged,
    )


def _smear_share(
    spectrum: CrossSpectrum, lines: npt.NDArray[np.bool_], n_integrations: int
) -> FloatArray:
    """Share of a bearing line that is integrated with a wrong frequency, (n_used, 1)."""
    bin_hz = spectrum.frequency_hz[1] - spectrum.frequency_hz[0]
    slope = n_integrations * bin_hz / spectrum.frequency_hz[lines, np.newaxis]
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
