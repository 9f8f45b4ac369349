"""What the broadband motion of a bearing says: all eight film coefficients as readings."""

from collections.abc import Mapping

import numpy as np

from core.cross_spectrum import CrossSpectrum
from core.dynamic import DynamicStiffness, dynamic_stiffness
from core.dynamic_settings import DynamicSettings
from core.line_results import reading_of
from core.machine import Bearing
from core.quality import Quality, Reading, Reason, missing, uncertain, worst
from core.quantities import AXES
from core.stiffness_budget import dynamic_budgets
from core.uncertainty import Budget

MAX_LACK_OF_FIT = 3.0
"""Beyond it the film is not constant over the band, or something shakes the bracket directly."""

NAMES = (
    *(f"dynamic_k_{axes}_n_per_m" for axes in AXES),
    *(f"dynamic_c_{axes}_n_s_per_m" for axes in AXES),
    *(f"dynamic_{what}_{axis}" for what in ("coherence", "lack_of_fit") for axis in "xy"),
    "dynamic_n_lines",
)


def film_results(
    bearing: Bearing,
    spectrum: CrossSpectrum | None,
    turn_hz: tuple[float, float],
    quality: Quality,
    settings: DynamicSettings,
) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
    """Readings of `dynamic` and the budgets of its coefficients.

    Parameters
    ----------
    spectrum
        Averaged over the segments in which all four channels were usable; None if there are none.
    turn_hz
        Lowest and highest 1× frequency in these segments.
    quality
        Of everything that goes in; if bad, its reason is the answer.
    """
    if spectrum is None:
        return dict.fromkeys(NAMES, missing(quality.reason)), {}
    found = dynamic_stiffness(spectrum, bearing.bracket, turn_hz, settings)
    if isinstance(found, Reason):
        return dict.fromkeys(NAMES, missing(found)), {}
    if np.any(found.lack_of_fit > MAX_LACK_OF_FIT):
        quality = worst((quality, uncertain(Reason.POOR_FIT)))
    budgets = {
        f"dynamic_{name}_{'n_per_m' if name[0] == 'k' else 'n_s_per_m'}": budget
        for name, budget in dynamic_budgets(found, bearing.accuracy).items()
    }
    readings = {name: reading_of(budget, quality) for name, budget in budgets.items()}
    return readings | _evidence(found, quality), budgets


def _evidence(found: DynamicStiffness, quality: Quality) -> dict[str, Reading]:
    evidence = {
        "dynamic_coherence_x": found.coherence[0],
        "dynamic_coherence_y": found.coherence[1],
        "dynamic_lack_of_fit_x": found.lack_of_fit[0],
        "dynamic_lack_of_fit_y": found.lack_of_fit[1],
        "dynamic_n_lines": found.frequency_hz.size,
    }
    return {name: Reading(float(value), quality) for name, value in evidence.items()}
