"""Budgets of the three estimators of film stiffness: which errors reach which result, and how."""

import math

import numpy as np

from core.bracket import BracketDynamics
from core.cross_spectrum import CrossSpectrum
from core.dynamic import DynamicStiffness
from core.transfer import LineTransfer
from core.uncertainty import BearingAccuracy, Budget, BudgetLine, random_line, systematic_line

STATISTICS = "spectral statistics"
SHAFT_GAIN = "gain of shaft probe"
BEARING_GAIN = "gain of bearing transducer"
BRACKET = "bracket stiffness"
RUNOUT = "runout"

RESOLUTION = 0.001
"""Half-width, relative to a row's direct coefficient, of what tapering does to `dynamic`: a line
holds motion of its neighbours, which is integrated with the line's own frequency. Found to be
0.03 % in simulations without any noise, at 0.07 Hz a bin."""


def _gains(value: float, accuracy: BearingAccuracy) -> tuple[BudgetLine, BudgetLine]:
    """Results are proportional to bearing motion and inversely to shaft motion."""
    return (
        systematic_line(SHAFT_GAIN, accuracy.shaft_gain, -value),
        systematic_line(BEARING_GAIN, accuracy.bearing_gain, value),
    )


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
    """Uncertainty of equation (5), ``|X_b| / |U| k_b``.

    What is not coherent sits in one of the two amplitudes, and it is not known in which: the ratio
    may be high or low by 1/γ - 1. The bracket's inertia, where its mass is known, is left out by
    equation (5) and stated as what it may amount to.

    Parameters
    ----------
    n_segments
        Independent segments; by default those that were averaged.
    runout_um_pk
        Largest runout of the shaft's surface at this line, not taken off: it counts at harmonics of
        the running speed, not at the vortex.

    Returns
    -------
    None without shaft motion, coherence or a second segment.
    """
    counted = float(spectrum.n_segments[shaft, bearing]) if n_segments is None else n_segments
    coherence = float(spectrum.coherence(shaft, bearing)[line])
    if coherence <= 0.0 or counted < 2.0:
        return None
    value = float(spectrum.amplitude_ratio(bearing, shaft)[line]) * bracket.stiffness_n_per_m
    shaft_um_pk = float(spectrum.amplitude_um_pk(shaft)[line])
    omega = 2.0 * math.pi * float(spectrum.frequency_hz[line])
    # two powers of n segments, correlated by γ²: Bendat and Piersol, 9.1
    random = value * math.sqrt((1.0 - coherence) / (2.0 * (counted - 1.0)))
    inertia = bracket.mass_kg * omega**2 / bracket.stiffness_n_per_m
    return Budget(
        value,
        (
            random_line(STATISTICS, random, 2.0 * (counted - 1.0)),
            *_gains(value, accuracy),
            systematic_line(BRACKET, accuracy.bracket_stiffness, value),
            systematic_line("incoherent motion", 1.0 / math.sqrt(coherence) - 1.0, value),
            systematic_line("bracket inertia left out", inertia, value),
            systematic_line(RUNOUT, runout_um_pk, value / shaft_um_pk),
        ),
    )


def transfer_budgets(
    found: LineTransfer, accuracy: BearingAccuracy, runout_um_pk: float = 0.0
) -> tuple[Budget, Budget]:
    """Uncertainty of stiffness in N/m and damping in N·s/m from `transfer`.

    Parameters
    ----------
    runout_um_pk
        As for `ratio_budget`; its phase is not known, so that it reaches damping as well.
    """
    omega = 2.0 * math.pi * found.frequency_hz
    film = math.hypot(found.k_n_per_m, omega * found.c_n_s_per_m) / found.shaft_um_pk
    stiffness, damping = (
        Budget(
            value,
            (
                random_line(STATISTICS, std, 2.0 * (found.n_segments - 1.0)),
                *_gains(value, accuracy),
                systematic_line(BRACKET, accuracy.bracket_stiffness, per_bracket),
                systematic_line(RUNOUT, runout_um_pk, per_um),
            ),
        )
        for value, std, per_bracket, per_um in (
            (found.k_n_per_m, found.k_std_n_per_m, found.k_per_bracket_n_per_m, film),
            (
                found.c_n_s_per_m,
                found.c_std_n_s_per_m,
                found.c_per_bracket_n_s_per_m,
                film / omega,
            ),
        )
    )
    return stiffness, damping


def dynamic_budgets(found: DynamicStiffness, accuracy: BearingAccuracy) -> dict[str, Budget]:
    """Uncertainty of all eight coefficients from `dynamic`.

    Returns
    -------
    By name, ``k_xx`` in N/m to ``c_yy`` in N·s/m.
    """
    parts = {
        "k": (found.k_n_per_m, found.k_std_n_per_m, found.k_per_bracket_n_per_m),
        "c": (found.c_n_s_per_m, found.c_std_n_s_per_m, found.c_per_bracket_n_s_per_m),
    }
    # a shaft spectrum that is too large by a share makes every coefficient too small by as much
    left_in = found.noise_share / (1.0 - found.noise_share)
    return {
        f"{letter}_{'xy'[row]}{'xy'[column]}": Budget(
            float(value[row, column]),
            (
                random_line(STATISTICS, float(std[row, column])),
                *_gains(float(value[row, column]), accuracy),
                systematic_line(
                    BRACKET, accuracy.bracket_stiffness, float(per_bracket[row, column])
                ),
                systematic_line(
                    "probe noise taken off",
                    accuracy.probe_noise,
                    float(value[row, column]) * left_in,
                ),
                systematic_line("spectral resolution", RESOLUTION, float(value[row, row])),
            ),
        )
        for letter, (value, std, per_bracket) in parts.items()
        for row, column in np.ndindex(2, 2)
    }
