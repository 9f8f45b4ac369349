"""All eight film coefficients from the broadband motion of a bearing, as readings."""

import math

import numpy as np

from core.machine.unit import Bearing
from core.quality import AXES, GOOD, Quality, Reading, Reason, missing, uncertain, worst
from core.spectra.cross_spectrum import CrossSpectrum
from core.stiffness.agreement import FALSE_ALARM
from core.stiffness.channel_budget import coherence_budget
from core.stiffness.dynamic import DynamicStiffness, dynamic_stiffness
from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.stiffness_budget import (
    BRACKET,
    DAMPING,
    STATISTICS,
    damping_half_width_n_s_per_m,
    dynamic_budgets,
)
from core.uncertainty import (
    Budget,
    coverage_factor,
    random_line,
    systematic_line,
    with_budgets,
)

MAX_LACK_OF_FIT = 3.0
"""Beyond it the film is not constant over the band, or something shakes the bracket directly."""

NAMES = (
    *(f"dynamic_k_{axes}_n_per_m" for axes in AXES),
    *(f"dynamic_c_{axes}_n_s_per_m" for axes in AXES),
    *(f"dynamic_{what}_{axis}" for what in ("coherence", "lack_of_fit") for axis in "xy"),
    "dynamic_n_lines",
    "dynamic_delay_s",
    "dynamic_bracket_mass_kg",
)


def dynamic_readings(
    bearing: Bearing,
    spectrum: CrossSpectrum | None,
    turn_hz: tuple[float, float],
    quality: Quality,
    settings: DynamicSettings,
    n_integrations: tuple[int, int] = (2, 2),
) -> tuple[dict[str, Reading], dict[str, Budget], DynamicStiffness | None]:
    """Readings of `dynamic`, the budgets of its coefficients, and what it found.

    Parameters
    ----------
    spectrum
        Averaged over the segments in which all four channels were usable; None if there are none.
    turn_hz
        Lowest and highest 1× frequency in these segments.
    quality
        Of everything that goes in; if bad, its reason is the answer.
    n_integrations
        From the measurands of v_x and v_y to displacement.
    """
    if spectrum is None:
        return dict.fromkeys(NAMES, missing(quality.reason)), {}, None
    found = dynamic_stiffness(spectrum, bearing.bracket, turn_hz, settings, n_integrations)
    if isinstance(found, Reason):
        return dict.fromkeys(NAMES, missing(found)), {}, None
    quality = worst((quality, _fit_quality(found, bearing)))
    budgets = {
        f"dynamic_{name}_{'n_per_m' if name[0] == 'k' else 'n_s_per_m'}": budget
        for name, budget in dynamic_budgets(found, bearing.bracket, bearing.accuracy).items()
    }
    readings = {name: budget.reading(quality) for name, budget in budgets.items()}
    of_evidence = _evidence_budgets(found, bearing)
    evidence, others = with_budgets(
        {
            name: (reading, of_evidence.get(name))
            for name, reading in _evidence(found, bearing, quality).items()
        }
    )
    return readings | evidence, budgets | others, found


def _fit_quality(found: DynamicStiffness, bearing: Bearing) -> Quality:
    """Whether one constant film on this bracket explains the motion, with channels in step."""
    sure = coverage_factor((), 1.0 - FALSE_ALARM)
    damping = _damping_half_width_n_s_per_m(found, bearing)
    limits_s = bearing.accuracy.delay_s + abs(found.delay_per_damping) * damping
    if abs(found.delay_s) > limits_s + sure * found.delay_std_s:
        return uncertain(Reason.CHANNEL_DELAY)
    massless = found.bracket_mass_kg < -sure * found.bracket_mass_std_kg
    if massless or np.any(found.lack_of_fit > MAX_LACK_OF_FIT):
        return uncertain(Reason.POOR_FIT)
    return GOOD


def _evidence(found: DynamicStiffness, bearing: Bearing, quality: Quality) -> dict[str, Reading]:
    evidence = {
        "dynamic_coherence_x": found.coherence[0],
        "dynamic_coherence_y": found.coherence[1],
        "dynamic_lack_of_fit_x": found.lack_of_fit[0],
        "dynamic_lack_of_fit_y": found.lack_of_fit[1],
        "dynamic_n_lines": found.frequency_hz.size,
        "dynamic_delay_s": found.delay_s,
    }
    readings = {name: Reading(float(value), quality) for name, value in evidence.items()}
    readings["dynamic_bracket_mass_kg"] = (
        Reading(found.bracket_mass_kg, quality)
        if bearing.bracket.mass_kg is None
        else missing(Reason.SWITCHED_OFF)
    )
    return readings


def _damping_half_width_n_s_per_m(found: DynamicStiffness, bearing: Bearing) -> float:
    mass_kg = max(found.bracket_mass_kg, 0.0)
    return damping_half_width_n_s_per_m(bearing.bracket, mass_kg, bearing.accuracy)


def _evidence_budgets(found: DynamicStiffness, bearing: Bearing) -> dict[str, Budget | None]:
    """Of what is measured beside the film; a fitted mass is proportional to the stiffness given."""
    of_coherence = zip(found.coherence.tolist(), found.coherence_segments.tolist(), strict=True)
    x, y = (coherence_budget(coherence, n) for coherence, n in of_coherence)
    damping, mass_kg = _damping_half_width_n_s_per_m(found, bearing), found.bracket_mass_kg
    stiffness = bearing.accuracy.bracket_stiffness
    delay_lines = (
        random_line(STATISTICS, found.delay_std_s),
        systematic_line(DAMPING, damping, found.delay_per_damping),
    )
    mass_lines = (
        random_line(STATISTICS, found.bracket_mass_std_kg),
        systematic_line(BRACKET, stiffness, mass_kg),
    )
    known = math.isfinite(found.delay_std_s)
    return {
        "dynamic_coherence_x": x,
        "dynamic_coherence_y": y,
        "dynamic_delay_s": Budget(found.delay_s, delay_lines) if known else None,
        "dynamic_bracket_mass_kg": Budget(mass_kg, mass_lines),
    }
