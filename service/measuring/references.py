"""References of gaps and 1× vectors: in force, entered by a user, or from the newest result."""

from core.alarms.judgements import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from core.machine.unit import Bearing
from core.monitor.assessment import BearingResult
from core.quality import Level, Reason
from core.stiffness.order_line import AMPLITUDES
from core.units import s_from_ns
from service.live.commands import ReferenceRefusedError
from service.live.references import opposite_axes
from service.runtime.times import rfc3339
from service.store.port import StoredReadings
from service.store.references import MicrometrePair

MAX_AGE_S = 600.0
"""Maximum age, s, of a result whose gaps are used as a reference."""

NEAR_GAPS = ("gap_x_um", "gap_y_um")
OPPOSITE_GAPS = ("opposite_gap_x_um", "opposite_gap_y_um")

GivenPair = tuple[float | None, float | None]
Gaps = tuple[MicrometrePair, MicrometrePair | None]
"""Gaps (x, y) of the probes on the positive axes; gaps of the opposite probes or None."""


def given_gaps(bearing: Bearing, near: GivenPair, opposite: GivenPair) -> Gaps:
    """Check gaps (x, y) in µm, entered by a user, against the probes of a bearing; return them.

    ``near`` are gaps of the probes on the positive axes, ``opposite`` are gaps of the opposite
    probes.

    Raises `ReferenceRefusedError` if a gap is missing, or given for a probe that the bearing does
    not have.
    """
    x, y = near
    if x is None or y is None:
        raise ReferenceRefusedError("give the gaps in x and y, or neither to use the newest result")
    for axis, gap_um, is_there in zip("xy", opposite, opposite_axes(bearing), strict=True):
        if gap_um is None and is_there:
            raise ReferenceRefusedError(
                f"bearing {bearing.id} has an opposite probe in {axis}; give its gap as well"
            )
        if gap_um is not None and not is_there:
            words = f"bearing {bearing.id} has no opposite probe in {axis}; omit its gap"
            raise ReferenceRefusedError(words)
    if not any(opposite_axes(bearing)):
        return (x, y), None
    # an axis without opposite probe needs a placeholder
    unused_x, unused_y = bearing.opposite_reference_um or (x, y)
    opposite_x, opposite_y = opposite
    across_x = unused_x if opposite_x is None else opposite_x
    return (x, y), (across_x, unused_y if opposite_y is None else opposite_y)


def measured_gaps(bearing: Bearing, newest: StoredReadings | None, now_ns: int) -> Gaps:
    """Return the mean gaps (x, y) in µm of the newest stored result of a bearing.

    `now_ns` is the host time, ns since 1970 UTC. Raises `ReferenceRefusedError` if there is no
    result, it is not of the last ten minutes, or a gap has no value.
    """
    if newest is None:
        raise ReferenceRefusedError("no result is stored yet; wait for one or give the gaps")
    age_s = s_from_ns(now_ns - newest.time_ns)
    if abs(age_s) > MAX_AGE_S:
        side = "ago" if age_s > 0.0 else "ahead of this computer's clock"
        raise ReferenceRefusedError(
            f"the newest result is from {rfc3339(newest.time_ns)}, {abs(age_s) / 60:.0f} min"
            f" {side}; the maximum age is {MAX_AGE_S / 60:.0f} min"
        )
    near_x, near_y = (_usable(newest, name) for name in NEAR_GAPS)
    x, y = (
        _usable(newest, name) if is_there else None
        for name, is_there in zip(OPPOSITE_GAPS, opposite_axes(bearing), strict=True)
    )
    return given_gaps(bearing, (near_x, near_y), (x, y))


def doubts(newest: StoredReadings) -> list[str]:
    """Return a warning for each gap of the newest result that is usable but uncertain."""
    gaps = {name: newest.readings.get(name) for name in (*NEAR_GAPS, *OPPOSITE_GAPS)}
    return [
        f"{name} is uncertain: {reading.quality.reason}"
        for name, reading in gaps.items()
        if reading is not None and reading.quality.level is Level.UNCERTAIN
    ]


def _usable(newest: StoredReadings, name: str) -> float:
    reading = newest.readings.get(name)
    if reading is None:
        raise ReferenceRefusedError(f"the newest stored result has no {name}; give the gaps")
    if reading.value is None:
        raise ReferenceRefusedError(
            f"{name} of the newest stored result has no value"
            f" ({reading.quality.reason}); wait for another result or give the gaps"
        )
    return reading.value


NOT_STEADY = (Reason.NON_STATIONARY, Reason.SPEED_IMPLAUSIBLE, Reason.FEW_SEGMENTS)
"""Quality reasons with which an uncertain amplitude cannot be a reference."""


def measured_vectors(assessment: BearingResult | None) -> VectorReference:
    """Return the 1× vectors of a result as the reference for the operating state of the result.

    Raises `ReferenceRefusedError` if there is no result, an amplitude has no value, or the machine
    did not run steadily.
    """
    if assessment is None:
        raise ReferenceRefusedError("the bearing has no current result; check its samples")
    condition = assessment.condition
    return VectorReference(
        unit=assessment.unit,
        bearing=assessment.bearing,
        state=OperatingState.UNKNOWN if condition is None else condition.state,
        vectors={place: _vector(assessment, place) for place in AMPLITUDES},
    )


def _vector(assessment: BearingResult, place: str) -> OrderVector:
    name, phase = f"order1_{place}_um_pk", assessment.readings[f"order1_{place}_phase_deg"]
    amplitude = assessment.readings[name]
    reason = amplitude.quality.reason
    if amplitude.value is None:
        raise ReferenceRefusedError(f"{name} has no value: {reason}")
    if amplitude.quality.level is not Level.GOOD and reason in NOT_STEADY:
        raise ReferenceRefusedError(f"{name} is uncertain: {reason}")
    return OrderVector(amplitude.value, phase.value)
