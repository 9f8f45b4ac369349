"""Vector change: how far a 1× vector has moved from where it was when all was well.

A crack, a loose part or a rub can turn the vector and leave its length as it was, so that the
length of the complex difference is judged. Without a phase only the difference of the lengths is
known, which is never more than that.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Condition, Limits, judge, unknown
from core.quality import Reading, worst

NO_REFERENCE, NO_PHASE = "no_reference", "no_phase"
AMPLITUDE_ONLY = {"ok": "amplitude_change_only", "above_limit": "amplitude_change_above_limit"}
"""What a condition says that was judged without a phase."""


@dataclass(frozen=True)
class OrderVector:
    """A 1× vector.

    Parameters
    ----------
    phase_deg
        Where it leads the key-phase; None where it is not known.

    Raises
    ------
    ValueError
        If the amplitude is not a number of zero or more, or the phase no number.
    """

    amplitude_um_pk: float
    phase_deg: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.amplitude_um_pk) and self.amplitude_um_pk >= 0.0):
            raise ValueError(f"amplitude {self.amplitude_um_pk:g} must be a number of 0 or more")
        if self.phase_deg is not None and not math.isfinite(self.phase_deg):
            raise ValueError(f"phase {self.phase_deg:g} must be a number")

    def change_um_pk(self, other: "OrderVector") -> float:
        """Length of the difference; that of the lengths alone where a phase is missing."""
        if self.phase_deg is None or other.phase_deg is None:
            return abs(self.amplitude_um_pk - other.amplitude_um_pk)
        return abs(self.phasor_um_pk - other.phasor_um_pk)

    @property
    def phasor_um_pk(self) -> complex:
        """The vector; of phase 0 where none is known."""
        return cmath.rect(self.amplitude_um_pk, math.radians(self.phase_deg or 0.0))


@dataclass(frozen=True)
class VectorReference:
    """The 1× vectors of a bearing that is well, in one operating state.

    Parameters
    ----------
    vectors
        By place: "shaft_x", "shaft_y", "bearing_x", "bearing_y", as far as they are known.
    """

    unit: str
    bearing: str
    state: OperatingState
    vectors: Mapping[str, OrderVector]


def vector_condition(
    readings: Mapping[str, Reading],
    place: str,
    reference: VectorReference | None,
    limits: Limits,
    held: AlarmLevel | None,
) -> Condition:
    """Compare a vector with its reference.

    What is known without a phase may raise an alarm, but does not clear one where the reference has
    a phase.

    Parameters
    ----------
    held
        The level of the condition before.
    """
    amplitude = readings[f"order1_{place}_um_pk"]
    before = reference.vectors.get(place) if reference else None
    if amplitude.value is None:
        return judge(amplitude, limits, held)
    if before is None:
        return unknown(NO_REFERENCE)
    phase = readings[f"order1_{place}_phase_deg"]
    change = OrderVector(amplitude.value, phase.value).change_um_pk(before)
    has_phase = phase.value is not None and before.phase_deg is not None
    quality = worst((amplitude.quality, phase.quality)) if has_phase else amplitude.quality
    found = judge(Reading(change, quality), limits, held)
    if has_phase or not found.is_known:
        return found
    if before.phase_deg is not None and (found.level or 0) < (held or 0):
        return unknown(NO_PHASE)
    return replace(found, reason=AMPLITUDE_ONLY.get(found.reason, found.reason))
