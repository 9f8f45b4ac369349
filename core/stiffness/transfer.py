"""Film stiffness at one line: equation (5) by amplitudes, `transfer` by their complex ratio."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.machine.unit import BracketDynamics
from core.spectra.cross_spectrum import SHAFT_X, SHAFT_Y, CrossSpectrum


def effective_stiffness_n_per_m(
    bearing_um_pk: float, shaft_um_pk: float, bracket_stiffness_n_per_m: float
) -> float:
    """Effective stiffness ``|k + iωc|`` of an oil film at one spectral line.

    Parameters
    ----------
    bearing_um_pk
        Absolute displacement of the bearing.
    shaft_um_pk
        Displacement of the shaft relative to the bearing, same direction and line. The two
        amplitudes may carry any unit and detector as long as it is the same.
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket. Its inertia is left out, which biases the result by
        m_b ω² / k_b (+0.4 % on the paper's machine at rated speed).

    Raises
    ------
    ValueError
        If the shaft amplitude is not positive.
    """
    if not shaft_um_pk > 0.0:
        raise ValueError(f"shaft amplitude must be above 0 µm, got {shaft_um_pk}")
    # Brito et al., equation (5): k_eff = |X_b| / |U| · k_b
    return bearing_um_pk / shaft_um_pk * bracket_stiffness_n_per_m


@dataclass(frozen=True)
class LineTransfer:
    """Dynamic stiffness in one direction at one frequency.

    Other than `dynamic` it sees one direction at a time, so that a film with cross-coupling shows
    in it as ``k_xx + k_xy · u_y / u_x``.

    Parameters
    ----------
    k_n_per_m, c_n_s_per_m
        Real part, and imaginary part over ω.
    k_std_n_per_m, c_std_n_s_per_m
        Random standard uncertainties.
    ratio
        Bearing motion per shaft motion.
    across
        Shaft motion across this direction per motion along it.
    shaft_um_pk
        Amplitude of the shaft's motion.
    coherence
        Squared, of shaft and bearing motion.
    n_segments
        Independent segments behind the uncertainties.
    """

    frequency_hz: float
    k_n_per_m: float
    c_n_s_per_m: float
    k_std_n_per_m: float
    c_std_n_s_per_m: float
    ratio: complex
    across: complex
    shaft_um_pk: float
    coherence: float
    n_segments: float


def motion_across(spectrum: CrossSpectrum, line: int, shaft: int) -> complex:
    """Coherent shaft motion across a direction per motion along it; 1 if that is not known."""
    across = SHAFT_Y if shaft == SHAFT_X else SHAFT_X
    power = float(spectrum.power[line, shaft, across])
    return complex(spectrum.matrix[line, across, shaft]) / power if power > 0.0 else 1.0


@lru_cache(maxsize=64)
def _impedance(bracket: BracketDynamics, frequency_hz: float) -> complex:
    """Dynamic stiffness of a bracket, once for both directions."""
    return complex(bracket.dynamic_stiffness_n_per_m(np.array([frequency_hz]))[0])


def line_transfer(
    spectrum: CrossSpectrum,
    line: int,
    shaft: int,
    bearing: int,
    bracket: BracketDynamics,
    n_segments: float | None = None,
) -> LineTransfer | None:
    """Estimate H1 with the shaft's motion as input: its result does not grow with bearing noise.

    Parameters
    ----------
    line
        Index in the spectrum's frequencies.
    shaft, bearing
        Channels of the same direction, as in `core.spectra.cross_spectrum`.
    n_segments
        Independent segments; by default those that were averaged.

    Returns
    -------
    None without shaft motion or with fewer than two segments: one shows no coherence.
    """
    shaft_power = float(spectrum.power[line, shaft, bearing])
    counted = float(spectrum.n_segments[shaft, bearing]) if n_segments is None else n_segments
    if shaft_power <= 0.0 or counted < 2.0:
        return None
    frequency_hz = float(spectrum.frequency_hz[line])
    omega = 2.0 * math.pi * frequency_hz
    ratio = complex(spectrum.matrix[line, bearing, shaft]) / shaft_power
    impedance = _impedance(bracket, frequency_hz)
    film = impedance * ratio
    coherence = spectrum.coherence_at(line, shaft, bearing)
    # Bendat and Piersol, Random Data, 4th ed., table 9.6, with n - 1 for what H1 itself takes up
    bearing_power = float(spectrum.power[line, bearing, shaft])
    left = (1.0 - coherence) * bearing_power / shaft_power
    std = abs(impedance) * math.sqrt(left / (2.0 * (counted - 1.0)))
    return LineTransfer(
        frequency_hz=frequency_hz,
        k_n_per_m=film.real,
        c_n_s_per_m=film.imag / omega,
        k_std_n_per_m=std,
        c_std_n_s_per_m=std / omega,
        ratio=ratio,
        across=motion_across(spectrum, line, shaft),
        shaft_um_pk=math.sqrt(shaft_power),
        coherence=coherence,
        n_segments=counted,
    )
