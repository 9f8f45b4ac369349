"""Budgets of the three estimators of film stiffness: which errors reach which result, and how."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.machine.unit import BearingAccuracy, BracketDynamics
from core.spectra.cross_spectrum import CrossSpectrum
from core.stiffness.dynamic import DynamicStiffness
from core.stiffness.transfer import LineTransfer, motion_across
from core.uncertainty import (
    SHAFT_GAIN,
    Budget,
    BudgetLine,
    effective_number,
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
    may be high or low by 1/γ - 1. The bracket's inertia is left out by equation (5) and stated as
    what it may amount to.

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
    coherence = spectrum.coherence_at(line, shaft, bearing)
    if coherence <= 0.0 or counted < 2.0:
        return None
    value = float(spectrum.amplitude_ratio(bearing, shaft)[line]) * bracket.stiffness_n_per_m
    # two powers of n segments, correlated by γ²: Bendat and Piersol, 9.1
    random = value * math.sqrt((1.0 - coherence) / (2.0 * (counted - 1.0)))
    lines = _ratio_lines(
        value,
        float(spectrum.frequency_hz[line]),
        bracket,
        accuracy,
        (runout_um_pk, float(spectrum.amplitude_um_pk(shaft)[line])),
        abs(motion_across(spectrum, line, shaft)),
        ("incoherent motion", coherence),
    )
    return Budget(value, (random_line(STATISTICS, random, 2.0 * (counted - 1.0)), *lines))


def polls_ratio_budget(
    shaft_um_pk: FloatArray,
    bearing_um_pk: FloatArray,
    frequency_hz: float,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    coherence: float,
    runout_um_pk: float = 0.0,
    across: float = 1.0,
) -> Budget | None:
    """Uncertainty of equation (5) over the polls of a rack.

    A rack may be asked more often than it measures, or average for longer than a poll period: the
    spread of the polls is divided by their effective number.

    Parameters
    ----------
    shaft_um_pk, bearing_um_pk : (n_polls,)
        Amplitudes of the same polls; shaft amplitudes above zero.
    coherence
        Squared, of the two; without phases the least that would be accepted of waveforms.
    runout_um_pk
        Largest runout at this line, not taken off.
    across
        Shaft amplitude across this direction over that along it.

    Returns
    -------
    None with fewer than two independent polls.
    """
    independent = n_effective(shaft_um_pk, bearing_um_pk)
    if independent < 2.0:
        return None
    shaft = float(np.sqrt(np.mean(shaft_um_pk**2)))
    value = float(np.sqrt(np.mean(bearing_um_pk**2))) / shaft * bracket.stiffness_n_per_m
    each = bearing_um_pk / shaft_um_pk * bracket.stiffness_n_per_m
    random = float(np.std(each, ddof=1)) / math.sqrt(independent)
    known = (COHERENCE, coherence)
    lines = _ratio_lines(
        value, frequency_hz, bracket, accuracy, (runout_um_pk, shaft), across, known
    )
    return Budget(value, (random_line(SPREAD, random, independent - 1.0), *lines))


def _ratio_lines(
    value: float,
    frequency_hz: float,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    runout_of_um_pk: tuple[float, float],
    across: float,
    coherence: tuple[str, float],
) -> tuple[BudgetLine, ...]:
    """Systematic contributions to equation (5); runout and shaft motion, name and coherence."""
    runout_um_pk, shaft_um_pk = runout_of_um_pk
    inertia = bracket.max_mass_kg * (2.0 * math.pi * frequency_hz) ** 2 / bracket.stiffness_n_per_m
    return (
        *_gains(value, accuracy),
        systematic_line(BRACKET, accuracy.bracket_stiffness, value),
        systematic_line(CROSS_COUPLING, accuracy.cross_coupling, value * across),
        systematic_line(coherence[0], 1.0 / math.sqrt(coherence[1]) - 1.0, value),
        systematic_line("bracket inertia left out", inertia, value),
        systematic_line(RUNOUT, runout_um_pk, value / shaft_um_pk),
    )


def n_changed(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> int:
    """Polls in which at least one of two amplitudes differs from the poll before."""
    return int(np.count_nonzero(_changed(shaft_um_pk, bearing_um_pk)))


def n_effective(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> float:
    """Number of independent polls with as much information, at least 2 of 2 or more.

    A rack averages, perhaps for longer than a poll period: neighbouring polls then share much of
    what they show.
    """
    changed = _changed(shaft_um_pk, bearing_um_pk)
    return effective_number(bearing_um_pk[changed] / shaft_um_pk[changed])


def _changed(shaft_um_pk: FloatArray, bearing_um_pk: FloatArray) -> npt.NDArray[np.bool_]:
    changed = np.ones(shaft_um_pk.size, dtype=np.bool_)
    changed[1:] = (np.diff(shaft_um_pk) != 0.0) | (np.diff(bearing_um_pk) != 0.0)
    return changed


def mass_half_width_kg(bracket: BracketDynamics, accuracy: BearingAccuracy) -> float:
    """Half-width of the bracket's mass; without one, all that it may be thought to have."""
    share = 1.0 if bracket.mass_kg is None else accuracy.bracket_mass
    return share * bracket.max_mass_kg


def damping_half_width_n_s_per_m(
    bracket: BracketDynamics, mass_kg: float, accuracy: BearingAccuracy
) -> float:
    """Half-width of the bracket's damping."""
    return 2.0 * accuracy.bracket_damping * math.sqrt(bracket.stiffness_n_per_m * mass_kg)


def transfer_budgets(
    found: LineTransfer,
    bracket: BracketDynamics,
    accuracy: BearingAccuracy,
    runout_um_pk: float = 0.0,
) -> tuple[Budget, Budget]:
    """Uncertainty of stiffness in N/m and damping in N·s/m from `transfer`.

    Parameters
    ----------
    runout_um_pk
        As for `ratio_budget`; its phase is not known, so that it reaches damping as well.
    """
    omega = 2.0 * math.pi * found.frequency_hz
    mass_kg = mass_half_width_kg(bracket, accuracy)
    damping = damping_half_width_n_s_per_m(bracket, bracket.max_mass_kg, accuracy)
    film = complex(found.k_n_per_m, omega * found.c_n_s_per_m)
    any_phase = abs(film) * (1.0 + 1.0j)

    def budget(value: float, std: float, part: Callable[[complex], float]) -> Budget:
        """Budget of a part of the film's dynamic stiffness, a linear function of it."""
        return Budget(
            value,
            (
                random_line(STATISTICS, std, 2.0 * (found.n_segments - 1.0)),
                *_gains(value, accuracy),
                systematic_line(
                    BRACKET,
                    accuracy.bracket_stiffness,
                    part(bracket.stiffness_n_per_m * found.ratio),
                ),
                systematic_line(MASS, mass_kg, part(-(omega**2) * found.ratio)),
                systematic_line(DAMPING, damping, part(1j * omega * found.ratio)),
                systematic_line(DELAY, accuracy.delay_s, part(1j * omega * film)),
                # all of it may be in the real or in the imaginary part
                systematic_line(RUNOUT, runout_um_pk, part(any_phase) / found.shaft_um_pk),
                systematic_line(
                    CROSS_COUPLING, accuracy.cross_coupling, part(any_phase) * abs(found.across)
                ),
            ),
        )

    return (
        budget(found.k_n_per_m, found.k_std_n_per_m, lambda z: z.real),
        budget(found.c_n_s_per_m, found.c_std_n_s_per_m, lambda z: z.imag / omega),
    )


def dynamic_budgets(
    found: DynamicStiffness, bracket: BracketDynamics, accuracy: BearingAccuracy
) -> dict[str, Budget]:
    """Uncertainty of all eight coefficients from `dynamic`.

    A mass that was fitted with the film is part of the statistics.

    Returns
    -------
    By name, ``k_xx`` in N/m to ``c_yy`` in N·s/m.
    """
    is_fitted = bracket.mass_kg is None
    mass_kg = 0.0 if is_fitted else mass_half_width_kg(bracket, accuracy)
    damping = damping_half_width_n_s_per_m(bracket, max(found.bracket_mass_kg, 0.0), accuracy)
    widths = (
        (BRACKET, accuracy.bracket_stiffness, found.per_stiffness),
        (MASS, mass_kg, found.per_mass),
        (DAMPING, damping, found.per_damping),
        (DELAY, accuracy.delay_s, found.per_delay),
    )
    # a shaft spectrum that is too large by a share makes every coefficient too small by as much
    left_in = found.noise_share / (1.0 - found.noise_share)
    budgets = {}
    for letter, attribute, std in (
        ("k", "k_n_per_m", found.k_std_n_per_m),
        ("c", "c_n_s_per_m", found.c_std_n_s_per_m),
    ):
        coefficients = getattr(found, attribute)
        for at in np.ndindex(2, 2):
            value = float(coefficients[at])
            budgets[f"{letter}_{'xy'[at[0]]}{'xy'[at[1]]}"] = Budget(
                value,
                (
                    random_line(STATISTICS, float(std[at])),
                    *_gains(value, accuracy),
                    *(
                        systematic_line(name, width, float(getattr(change, attribute)[at]))
                        for name, width, change in widths
                    ),
                    systematic_line("probe noise taken off", accuracy.probe_noise, value * left_in),
                    systematic_line(
                        "spectral resolution", RESOLUTION, float(coefficients[at[0], at[0]])
                    ),
                ),
            )
    return budgets
