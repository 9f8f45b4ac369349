"""The estimators of film stiffness by name, and the choice between them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

from core.machine.unit import Estimator
from core.quality import Reading, Reason, missing, worst

STIFFNESS_OF = {
    Estimator.DYNAMIC: "dynamic_k_{axes}_n_per_m",
    Estimator.TRANSFER_ORDER1: "order1_transfer_k_{axes}_n_per_m",
    Estimator.TRANSFER_VORTEX: "vortex_transfer_k_{axes}_n_per_m",
    Estimator.RATIO_ORDER1: "order1_k_eff_{axes}_n_per_m",
    Estimator.RATIO_VORTEX: "vortex_k_eff_{axes}_n_per_m",
}


MODEL_DOUBTS = frozenset({Reason.POOR_FIT, Reason.CHANNEL_DELAY, Reason.ESTIMATORS_DISAGREE})
"""Why a number with little scatter may be wrong."""


def preferred_stiffness(
    readings: Mapping[str, Reading], preference: Sequence[Estimator], axes: str
) -> tuple[Reading, Estimator | None]:
    """Take the first estimator in order of preference that is good, else the first with a number.

    A number of few segments is no stiffness yet: a single segment makes any noise coherent. One
    that stands in for another whose model does not hold is uncertain for the same reason: what
    spoils the one may reach the other.

    Parameters
    ----------
    axes
        "xx" or "yy".

    Returns
    -------
    Without any number: why the first choice has none, and no estimator.
    """
    found = [(readings[STIFFNESS_OF[e].format(axes=axes)], e) for e in preference]
    measured = [(r, e) for r, e in found if r.quality.reason is not Reason.NOT_MEASURED]
    found = measured or found
    numbers = [
        (reading, estimator)
        for reading, estimator in found
        if reading.value is not None and reading.quality.reason is not Reason.FEW_SEGMENTS
    ]
    if numbers:
        reading, estimator = min(numbers, key=lambda choice: choice[0].quality.level)
        before = itertools.takewhile(lambda choice: choice[1] is not estimator, numbers)
        doubts = (r.quality for r, _ in before if r.quality.reason in MODEL_DOUBTS)
        return replace(reading, quality=worst((reading.quality, *doubts))), estimator
    return missing(found[0][0].quality.reason), None
