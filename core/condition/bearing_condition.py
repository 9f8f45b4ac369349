"""Under which condition a bearing ran at one moment: `BearingCondition`, `OperatingPoint`."""

from dataclasses import dataclass

from core.condition.cells import Cell
from core.condition.operating_state import OperatingState


@dataclass(frozen=True)
class OperatingPoint:
    """Operating state, eccentricity, attitude and oil temperature; None where not known."""

    state: OperatingState = OperatingState.UNKNOWN
    eccentricity_ratio: float | None = None
    attitude_deg: float | None = None
    oil_temperature_c: float | None = None


NOWHERE_KNOWN = OperatingPoint()
"""Of which nothing is known."""


@dataclass(frozen=True)
class BearingCondition:
    """What a bearing's stiffness is compared by.

    Parameters
    ----------
    state
        What the unit does.
    is_settled
        Whether it has done so for the settling time, after the warm-up: only then are films alike.
    cell
        Bins of eccentricity ratio, oil temperature and, where it counts, attitude angle; None where
        one of them is not known.
    """

    state: OperatingState
    is_settled: bool
    cell: Cell | None
