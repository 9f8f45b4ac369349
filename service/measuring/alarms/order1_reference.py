"""A reference vector of 1× taken from the running machine."""

from core.alarms.judgements import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import Level, Reading, Reason
from core.stiffness.order_line import AMPLITUDES

NOT_STEADY = (Reason.NON_STATIONARY, Reason.SPEED_IMPLAUSIBLE, Reason.FEW_SEGMENTS)
"""Doubts with which an amplitude is no reference."""


class VectorRefusedError(Exception):
    """No reference can be made of this; the message says why."""


def measured_vectors(assessment: Assessment | None) -> VectorReference:
    """The 1× vectors of a current result, in the operating state that it was found in.

    Raises
    ------
    VectorRefusedError
        If there is no result, an amplitude has no number, or the machine did not run steadily.
    """
    if assessment is None:
        raise VectorRefusedError("there is no current result whose vectors could be taken")
    condition = assessment.condition
    return VectorReference(
        unit=assessment.unit,
        bearing=assessment.bearing,
        state=OperatingState.UNKNOWN if condition is None else condition.state,
        vectors={place: _vector(assessment, place) for place in AMPLITUDES},
    )


def _vector(assessment: Assessment, place: str) -> OrderVector:
    amplitude = _steady(f"order1_{place}_um_pk", assessment.readings[f"order1_{place}_um_pk"])
    phase = assessment.readings[f"order1_{place}_phase_deg"]
    return OrderVector(amplitude, phase.value)


def _steady(name: str, reading: Reading) -> float:
    reason = reading.quality.reason
    if reading.value is None:
        raise VectorRefusedError(f"{name} has no value: {reason}")
    if reading.quality.level is not Level.GOOD and reason in NOT_STEADY:
        raise VectorRefusedError(f"{name} is uncertain: {reason}")
    return reading.value
