"""Readings and uncertainty budgets of the eight film coefficients of `dynamic`."""

import itertools
import math

import numpy as np

from core.machine.unit import Bearing, BearingAccuracy, BracketDynamics
from core.quality import GOOD, Quality, Reading, Reason, missing, uncertain, worst
from core.stiffness.agreement import FALSE_ALARM
from core.stiffness.channel_budget import coherence_budget
from core.stiffness.dynamic import DynamicStiffness
from core.stiffness.estimators import DYNAMIC_COEFFICIENTS
from core.stiffness.stiffness_budget import (
    BRACKET,
    DAMPING,
    DELAY,
    MASS,
    STATISTICS,
    damping_half_width_n_s_per_m,
    gain_lines,
    mass_half_width_kg,
)
from core.uncertainty import (
    Budget,
    Budgeted,
    Found,
    coverage_factor,
    random_line,
    systematic_line,
    with_budgets,
)

MAX_LACK_OF_FIT = 3.0
"""Largest lack of fit of a good result. Above this value, stiffness and damping of the film vary
over the band, or the bracket is excited directly."""

RESOLUTION = 0.001
"""Half-width of the error of `dynamic` from tapering, relative to a row's direct coefficient. A
line contains motion of neighbouring lines, which is integrated with the wrong frequency.
Simulations without noise show 0.03 % at 0.07 Hz per bin."""

CK_NAMES = ("dynamic_ck_xx_s", "dynamic_ck_yy_s")
"""Names of direct damping over direct stiffness."""

NAMES = (
    *(name for row in DYNAMIC_COEFFICIENTS for name in row),
    *CK_NAMES,
    *(f"dynamic_{what}_{axis}" for what in ("coherence", "lack_of_fit") for axis in "xy"),
    "dynamic_n_lines",
    "dynamic_delay_s",
    "dynamic_bracket_mass_kg",
)


def dynamic_readings(bearing: Bearing, found: DynamicStiffness, quality: Quality) -> Found:
    """Return the readings of `dynamic` for a fitted film, with budgets.

    `quality` is the quality of the input; the quality of a reading is never better.
    """
    bracket, mass_kg = bearing.bracket, found.bracket_mass_kg
    damping = damping_half_width_n_s_per_m(bracket, mass_kg, bearing.accuracy)
    quality = worst((quality, fit_quality(found, bearing.accuracy.delay_s, damping)))
    coefficients = dynamic_budgets(found, bracket, bearing.accuracy)
    coefficients |= _ck_budgets(found, bracket, bearing.accuracy)
    of_film: dict[str, Budgeted] = {name: (missing(Reason.OUT_OF_RANGE), None) for name in CK_NAMES}
    of_film |= {name: (Reading(b.value, quality), b) for name, b in coefficients.items()}
    return with_budgets(of_film | _evidence(found, bearing, damping, quality))


def dynamic_budgets(
    found: DynamicStiffness, bracket: BracketDynamics, accuracy: BearingAccuracy
) -> dict[str, Budget]:
    """Return the uncertainty budgets of all eight coefficients of `dynamic`, by quantity.

    The uncertainty of a fitted mass is contained in the random part.
    """
    names, widths = _bracket_half_widths(found, bracket, accuracy)
    # coefficients are inversely proportional to the shaft spectrum
    left_in = found.noise_share / (1.0 - found.noise_share)
    std, model, coefficients = found.std.tolist(), found.model.tolist(), found.coefficients.tolist()
    changes, budgets = found.changes.transpose(1, 2, 0).tolist(), {}
    for row, column in itertools.product(range(2), range(4)):
        value, direct = coefficients[row][column], coefficients[row][row + 2 * (column // 2)]
        budgets[DYNAMIC_COEFFICIENTS[row][column]] = Budget(
            value,
            (
                random_line(STATISTICS, std[row][column]),
                *gain_lines(value, accuracy),
                *map(systematic_line, names, widths, changes[row][column]),
                systematic_line("probe noise taken off", accuracy.probe_noise, value * left_in),
                systematic_line("spectral resolution", RESOLUTION, direct),
                systematic_line("film over frequency", model[row][column], 1.0),
            ),
        )
    return budgets


def _bracket_half_widths(
    found: DynamicStiffness, bracket: BracketDynamics, accuracy: BearingAccuracy
) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Return names and half-widths of the bracket's errors, in the order of `found.changes`."""
    mass_kg = 0.0 if bracket.mass_kg is None else mass_half_width_kg(bracket, accuracy)
    damping = damping_half_width_n_s_per_m(bracket, found.bracket_mass_kg, accuracy)
    widths = (accuracy.bracket_stiffness, mass_kg, damping, accuracy.delay_s)
    return (BRACKET, MASS, DAMPING, DELAY), widths


def _ck_budgets(
    found: DynamicStiffness, bracket: BracketDynamics, accuracy: BearingAccuracy
) -> dict[str, Budget]:
    """Return the uncertainty budgets of damping over stiffness, for a positive stiffness.

    Gains and probe noise cancel. Stiffness and damping of one fit are correlated.
    """
    names, widths = _bracket_half_widths(found, bracket, accuracy)
    budgets = {}
    for row, name in enumerate(CK_NAMES):
        k, c = (float(found.coefficients[row, column]) for column in (row, row + 2))
        if k <= 0.0:
            continue
        per = np.zeros(4)
        per[row], per[row + 2] = -c / k**2, 1.0 / k
        model = math.hypot(*(per * found.model[row]).tolist())
        budgets[name] = Budget(
            c / k,
            (
                random_line(STATISTICS, math.sqrt(float(per @ found.covariance[row] @ per))),
                *map(systematic_line, names, widths, (found.changes[:, row] @ per).tolist()),
                systematic_line("spectral resolution", RESOLUTION, math.sqrt(2.0) * abs(c / k)),
                systematic_line("film over frequency", model, 1.0),
            ),
        )
    return budgets


def fit_quality(found: DynamicStiffness, max_delay_s: float, damping: float) -> Quality:
    """Return the quality of the fit: uncertain if it shows a channel delay or is poor.

    A delay is accepted up to `max_delay_s` plus the apparent delay due to an error of the bracket
    damping of `damping`, N·s/m.
    """
    sure = coverage_factor((), 1.0 - FALSE_ALARM)
    limits_s = max_delay_s + abs(found.delay_per_damping) * damping
    doubt = 0.0 if found.late_share > 0.5 else sure * found.delay_std_s
    if abs(found.delay_s) > limits_s + doubt:
        return uncertain(Reason.CHANNEL_DELAY)
    massless = found.bracket_mass_kg < -sure * found.bracket_mass_std_kg
    if massless or np.any(found.lack_of_fit > MAX_LACK_OF_FIT):
        return uncertain(Reason.POOR_FIT)
    return GOOD


def _evidence(
    found: DynamicStiffness, bearing: Bearing, damping: float, quality: Quality
) -> dict[str, Budgeted]:
    """Return coherence, lack of fit, number of lines, delay and bracket mass with their budgets.

    The error of the given bracket stiffness enters a fitted mass in proportion.
    """
    evidence: dict[str, Budgeted] = {}
    for axis, coherence, n_segments, lack_of_fit in zip(
        "xy", found.coherence, found.coherence_segments, found.lack_of_fit, strict=True
    ):
        budget = coherence_budget(float(coherence), float(n_segments))
        evidence[f"dynamic_coherence_{axis}"] = Reading(float(coherence), quality), budget
        evidence[f"dynamic_lack_of_fit_{axis}"] = Reading(float(lack_of_fit), quality), None
    evidence["dynamic_n_lines"] = Reading(float(found.frequency_hz.size), quality), None
    delay_lines = (
        random_line(STATISTICS, found.delay_std_s),
        systematic_line(DAMPING, damping, found.delay_per_damping),
    )
    delay = Budget(found.delay_s, delay_lines) if math.isfinite(found.delay_std_s) else None
    evidence["dynamic_delay_s"] = Reading(found.delay_s, quality), delay
    mass_kg, stiffness = found.bracket_mass_kg, bearing.accuracy.bracket_stiffness
    mass_lines = (
        random_line(STATISTICS, found.bracket_mass_std_kg),
        systematic_line(BRACKET, stiffness, mass_kg),
    )
    is_fitted = bearing.bracket.mass_kg is None
    mass = Reading(mass_kg, quality) if is_fitted else missing(Reason.SWITCHED_OFF)
    evidence["dynamic_bracket_mass_kg"] = mass, Budget(mass_kg, mass_lines)
    return evidence
