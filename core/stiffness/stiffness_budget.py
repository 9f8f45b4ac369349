"""Film stiffness at one line by equation (5) and `transfer`, with uncertainty budgets."""

import math
from collections.abc import Callable

import numpy as np

from core.arrays import BoolArray, FloatArray
from core.machine.unit import BearingAccuracy, BracketDynamics
from core.spectra.cross_spectrum import SHAFT_X, SHAFT_Y, CrossSpectrum
from core.uncertainty import (
    SHAFT_GAIN,
    Budget,
    BudgetLine,
    random_line,
    systematic_line,
)

STATISTICS = "spectral statistics"
BEARING_GAIN = "gain of bearing transducer"
BRACKET = "bracket stiffness"
MASS = "bracket mass"
DAMPING = "bracket damping"
CROSS_COUPLING = "cross-coupling not known"
DELAY = "delay between channels"
RUNOUT = "runout"
SPREAD = "spread of polls"
COHERENCE = "coherence not known"


def gain_lines(value: float, accuracy: BearingAccuracy) -> tuple[BudgetLine, BudgetLine]:
    """Return the uncertainty that the gains of shaft and bearing transducers contribute to `value`.

    Stiffness and damping are proportional to bearing motion over shaft motion.
    """
    return (
        systematic_line(SHAFT_GAIN, accuracy.shaft_gain, -value),
        systematic_line(BEARING_GAIN, accuracy.bearing_gain, value),
    )


def effective_stiffness_n_per_m(
    bearing_um_pk: float, shaft_um_pk: float, bracket_stiffness_n_per_m: float
) -> float:
    """Return the effective stiffness ``|k + iωc|`` of an oil film at one spectral line.

    Parameters
    ----------
    bearing_um_pk
        Absolute displacement of the bearing.
    shaft_um_pk
        Displacement of the shaft relative to the bearing, same direction and line. Other units and
        detectors are possible if both amplitudes have the same.
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket. Its inertia is neglected, which biases the result by
        m_b ω² / k_b (+0.4 % on the machine of Brito et al. at rated speed).
    """
    # Brito et al., equation (5): k_eff = |X_b| / |U| · k_b
    return bearing_um_pk / shaft_um_pk * bracket_stiffness_n_per_m


def motion_across(spectrum: CrossSpectrum, line: int, shaft: int) -> complex:
    """Return the ratio of coherent motion across to motion along a shaft channel; 1 if unknown."""
    across = SHAFT_Y if shaft == SHAFT_X else SHAFT_X
    power = float(spectrum.power[line, shaft, across])
    return complex(spectrum.matrix[line, across, shaft]) / power if power > 0.0 else 1.0


def ratio_budget(
    spectrum: CrossSpectrum,
    line: int,
    shaft: int,
    bearing: int,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    n_segments: float | None = None,
    runout_um_pk: float = 0.0,
) -> Budget | None:
    """Return the stiffness by equation (5), ``|X_b| / |U| k_b``, with its uncertainty budget.

    The incoherent part may be in either amplitude, so the ratio may be too high or too low by the
    fraction 1/γ - 1. The budget contains the largest effect of the neglected bracket inertia.

    Parameters
    ----------
    spectrum, line, shaft, bearing
        Cross-spectrum, and the indices of the line and of the compared channels in it.
    bracket, accuracy
        Bracket, and accuracy of its properties and of the transducers.
    n_segments
        Number of independent segments; by default the number of averaged segments.
    runout_um_pk
        Largest shaft runout contained in this line; zero off the harmonics of the running speed.

    Returns
    -------
    The budget; None without shaft motion, coherence or a second segment.
    """
    counted = float(spectrum.n_segments[shaft, bearing]) if n_segments is None else n_segments
    coherence = spectrum.coherence_at(line, shaft, bearing)
    if coherence <= 0.0 or counted < 2.0:
        return None
    value = float(spectrum.amplitude_ratio(bearing, shaft)[line]) * bracket.stiffness_n_per_m
    # two powers of n segments, correlated by γ²: Bendat and Piersol, 9.1
    random = value * math.sqrt((1.0 - coherence) / (2.0 * (counted - 1.0)))
    lines = ratio_lines(
        value,
        float(spectrum.frequency_hz[line]),
        bracket,
        accuracy,
        (runout_um_pk, float(spectrum.amplitude_um_pk(shaft)[line])),
        abs(motion_across(spectrum, line, shaft)),
        ("incoherent motion", coherence),
    )
    return Budget(value, (random_line(STATISTICS, random, 2.0 * (counted - 1.0)), *lines))


def ratio_lines(
    value: float,
    frequency_hz: float,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    runout_of_um_pk: tuple[float, float],
    across: float,
    coherence: tuple[str, float],
) -> tuple[BudgetLine, ...]:
    """Return the systematic contributions to a stiffness `value` by equation (5).

    Parameters
    ----------
    frequency_hz, bracket, accuracy
        Frequency of the line, bracket, and accuracy of its properties and of the transducers.
    runout_of_um_pk
        Runout and amplitude of the shaft.
    across
        Ratio of the transverse shaft amplitude to the amplitude in this direction.
    coherence
        Name of the budget line for incoherence, and the squared coherence.
    """
    runout_um_pk, shaft_um_pk = runout_of_um_pk
    inertia = bracket.max_mass_kg * (2.0 * math.pi * frequency_hz) ** 2 / bracket.stiffness_n_per_m
    return (
        *gain_lines(value, accuracy),
        systematic_line(BRACKET, accuracy.bracket_stiffness, value),
        systematic_line(CROSS_COUPLING, accuracy.cross_coupling, value * across),
        systematic_line(coherence[0], 1.0 / math.sqrt(coherence[1]) - 1.0, value),
        systematic_line("bracket inertia left out", inertia, value),
        systematic_line(RUNOUT, runout_um_pk, value / shaft_um_pk),
    )


def changed_polls(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> BoolArray:
    """Return a mask (n_polls,) of the polls whose amplitudes differ from the poll before.

    The first poll counts as changed.
    """
    changed = np.ones(shaft_um_pk.size, dtype=np.bool_)
    changed[1:] = (np.diff(shaft_um_pk) != 0.0) | (np.diff(bearing_um_pk) != 0.0)
    return changed


def mass_half_width_kg(bracket: BracketDynamics, accuracy: BearingAccuracy) -> float:
    """Return the half-width of the error of the bracket's mass; the largest mass if unknown."""
    share = 1.0 if bracket.mass_kg is None else accuracy.bracket_mass
    return share * bracket.max_mass_kg


def damping_half_width_n_s_per_m(
    bracket: BracketDynamics, mass_kg: float, accuracy: BearingAccuracy
) -> float:
    """Return the half-width of the error of the bracket's damping.

    It is `accuracy.bracket_damping` times the critical damping 2 √(k m); 0 for a negative mass.
    """
    critical = math.sqrt(bracket.stiffness_n_per_m * max(mass_kg, 0.0))
    return 2.0 * accuracy.bracket_damping * critical


def transfer_budgets(
    spectrum: CrossSpectrum,
    line: int,
    shaft: int,
    bearing: int,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    n_segments: float | None = None,
    runout_um_pk: float = 0.0,
) -> tuple[Budget, Budget] | None:
    """Return the budgets, with values, of stiffness (N/m) and damping (N·s/m) by `transfer`.

    The H1 estimate with the shaft's motion as input is not biased by bearing noise. It contains one
    direction only: with cross-coupling, it gives ``k_xx + k_xy · u_y / u_x``.

    Parameters
    ----------
    spectrum, line, shaft, bearing
        Cross-spectrum, and the indices of the line and of the compared channels in it.
    bracket, accuracy
        Bracket, and accuracy of its properties and of the transducers.
    n_segments
        Number of independent segments; by default the number of averaged segments.
    runout_um_pk
        Largest shaft runout in this line. Its phase is unknown, so it also contributes to damping.

    Returns
    -------
    Both budgets; None without shaft motion or with fewer than two segments.
    """
    shaft_power = float(spectrum.power[line, shaft, bearing])
    counted = float(spectrum.n_segments[shaft, bearing]) if n_segments is None else n_segments
    if shaft_power <= 0.0 or counted < 2.0:
        return None
    omega = 2.0 * math.pi * float(spectrum.frequency_hz[line])
    ratio = complex(spectrum.matrix[line, bearing, shaft]) / shaft_power
    impedance = complex(bracket.dynamic_stiffness_n_per_m(spectrum.frequency_hz[[line]])[0])
    h1 = impedance * ratio
    k, c = h1.real, h1.imag / omega
    # Bendat and Piersol, Random Data, 4th ed., table 9.6, with n - 1 degrees of freedom
    incoherent = 1.0 - spectrum.coherence_at(line, shaft, bearing)
    left = incoherent * float(spectrum.power[line, bearing, shaft]) / shaft_power
    std = abs(impedance) * math.sqrt(left / (2.0 * (counted - 1.0)))
    mass_kg = mass_half_width_kg(bracket, accuracy)
    damping = damping_half_width_n_s_per_m(bracket, bracket.max_mass_kg, accuracy)
    across = abs(motion_across(spectrum, line, shaft))
    film = complex(k, omega * c)
    any_phase = abs(film) * (1.0 + 1.0j)  # of unknown phase: real or imaginary

    def budget(value: float, std: float, part: Callable[[complex], float]) -> Budget:
        """Return the budget of `part`, a linear function of the film's dynamic stiffness."""
        return Budget(
            value,
            (
                random_line(STATISTICS, std, 2.0 * (counted - 1.0)),
                *gain_lines(value, accuracy),
                systematic_line(
                    BRACKET, accuracy.bracket_stiffness, part(bracket.stiffness_n_per_m * ratio)
                ),
                systematic_line(MASS, mass_kg, part(-(omega**2) * ratio)),
                systematic_line(DAMPING, damping, part(1j * omega * ratio)),
                systematic_line(DELAY, accuracy.delay_s, part(1j * omega * film)),
                systematic_line(RUNOUT, runout_um_pk, part(any_phase) / math.sqrt(shaft_power)),
                systematic_line(CROSS_COUPLING, accuracy.cross_coupling, part(any_phase) * across),
            ),
        )

    return (
        budget(k, std, lambda z: z.real),
        budget(c, std / omega, lambda z: z.imag / omega),
    )
