"""The estimators of film stiffness by name, and the choice between them."""

from collections.abc import Mapping, Sequence
from enum import StrEnum

from core.quality import Reading, Reason, missing


class Estimator(StrEnum):
    """Where a stiffness may come from. The names appear in settings, API and store."""

    DYNAMIC = "dynamic"
    TRANSFER_ORDER1 = "transfer_order1"
    TRANSFER_VORTEX = "transfer_vortex"
    RATIO_ORDER1 = "ratio_order1"
    RATIO_VORTEX = "ratio_vortex"


PREFERENCE = (
    Estimator.DYNAMIC,
    Estimator.TRANSFER_VORTEX,
    Estimator.TRANSFER_ORDER1,
    Estimator.RATIO_VORTEX,
    Estimator.RATIO_ORDER1,
)
"""`dynamic` needs no line and is blind to runout; the vortex is off the harmonics, where runout is;
equation (5) includes damping and grows with bearing noise."""

STIFFNESS_OF = {
    Estimator.DYNAMIC: "dynamic_k_{axes}_n_per_m",
    Estimator.TRANSFER_ORDER1: "order1_transfer_k_{axes}_n_per_m",
    Estimator.TRANSFER_VORTEX: "vortex_transfer_k_{axes}_n_per_m",
    Estimator.RATIO_ORDER1: "order1_k_eff_{axes}_n_per_m",
    Estimator.RATIO_VORTEX: "vortex_k_eff_{axes}_n_per_m",
}


def preferred_stiffness(
    readings: Mapping[str, Reading], preference: Sequence[Estimator], axes: str
) -> tuple[Reading, Estimator | None]:
    """Take the first estimator in order of preference that is good, else the first with a number.

    A number of few segments is no stiffness yet: a single segment makes any noise coherent.

    Parameters
    ----------
    axes
        "xx" or "yy".

    Returns
    -------
    Without any number: why the first choice has none, and no estimator.
    """
    found = [(readings[STIFFNESS_OF[e].format(axes=axes)], e) for e in preference]
    numbers = [
        (reading, estimator)
        for reading, estimator in found
        if reading.value is not None and reading.quality.reason is not Reason.FEW_SEGMENTS
    ]
    if numbers:
        return min(numbers, key=lambda choice: choice[0].quality.level)
    return missing(found[0][0].quality.reason), None
