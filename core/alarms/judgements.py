"""Judgements of channels, of 1× vectors, and of the device's clock."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from core.alarms.kinds import Watch
from core.checks.sensor_checks import MAX_CLIPPED_SHARE
from core.condition.cells import OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import WITHIN, AlarmLevel, Judgement, unknown
from core.quality import NOT_MEASURED, Level, Quality, Reading, Reason, missing, worst
from core.samples.blocks import DeviceClock

COVERAGE = 1.96
"""Standard uncertainties on each side of a value that hold the truth with 95 %."""

SENSOR_FAULTS = (Reason.DEAD, Reason.STUCK, Reason.CLIPPED)
"""Faults of a channel that only a whole segment shows."""


def fault_judgement(fault: str | None) -> Judgement:
    """Alert for a fault; within limits without one."""
    return WITHIN if fault is None else Judgement(AlarmLevel.ALERT, reason=fault)


def channel_judgement(
    quality: Quality, segment_fault: Reason | None, clipped_percent: float | None = None
) -> Judgement:
    """Whether a waveform channel is OK, by its newest samples and its newest segment.

    Parameters
    ----------
    clipped_percent
        Share of clipped samples of that segment, %.
    """
    fault = segment_fault if quality.level is Level.GOOD else quality.reason
    found = fault_judgement(fault)
    if fault is not Reason.CLIPPED or clipped_percent is None:
        return found
    return replace(found, value=clipped_percent, limit=100.0 * MAX_CLIPPED_SHARE)


def fault_after_segment(
    fault: Reason | None, amplitude: Reading, has_wrong_sign: bool | None
) -> Reason | None:
    """Fault of a channel after a segment, which may show a fault or that there is none.

    Parameters
    ----------
    amplitude
        1× amplitude of the channel.
    has_wrong_sign
        Whether the stiffness of its direction shows a reversed transducer; None if unknown.
    """
    if amplitude.value is None and amplitude.quality.reason in SENSOR_FAULTS:
        return amplitude.quality.reason
    if amplitude.value is not None and fault in SENSOR_FAULTS:
        fault = None
    if has_wrong_sign is False and fault is Reason.POLARITY:
        return None
    return Reason.POLARITY if has_wrong_sign and fault is None else fault


def offset_reading(clock: DeviceClock | None) -> Reading:
    """Absolute offset of a device's time stamps from the host's clock, s."""
    if clock is None or clock.offset_s is None:
        return NOT_MEASURED
    return Reading(abs(clock.offset_s))


def drift_reading(clock: DeviceClock | None) -> Reading:
    """Absolute drift of a device's sampling that exceeds its uncertainty, parts per million."""
    if clock is None or clock.drift_ppm is None or clock.u_drift_ppm is None:
        return missing(Reason.WAITING_FOR_DATA)
    return Reading(max(0.0, abs(clock.drift_ppm) - COVERAGE * clock.u_drift_ppm))


CLOCK_READINGS = {"clock_offset": offset_reading, "clock_drift": drift_reading}
"""What is judged of a device's clock, by kind of alarm."""

NO_REFERENCE, NO_PHASE = "no_reference", "no_phase"
AMPLITUDE_ONLY = {"ok": "amplitude_change_only", "above_limit": "amplitude_change_above_limit"}
"""Reasons of a judgement without a phase."""


@dataclass(frozen=True)
class OrderVector:
    """A 1× vector; its phase, by which it leads the key-phase, is None where it is not known.

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
        """Length of the difference, or the difference of the lengths if a phase is missing."""
        if self.phase_deg is None or other.phase_deg is None:
            return abs(self.amplitude_um_pk - other.amplitude_um_pk)
        return abs(self.phasor_um_pk - other.phasor_um_pk)

    @property
    def phasor_um_pk(self) -> complex:
        """The vector; its phase is 0 if it is not known."""
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


def vector_judgement(
    readings: Mapping[str, Reading],
    watch: Watch,
    reference: VectorReference | None,
    point: OperatingPoint,
    held: AlarmLevel | None,
) -> Judgement:
    """Judge how far a 1× vector has moved from where it was when all was well.

    A crack, a loose part or a rub can turn the vector and leave its length as it was, so that the
    length of the complex difference is judged. Without a phase only the difference of the lengths
    is known, which is never more than that: it may raise an alarm, but does not clear one where the
    reference has a phase. The source of the watch is the place, such as "shaft_x".
    """
    place = watch.source
    amplitude = readings[f"order1_{place}_um_pk"]
    before = reference.vectors.get(place) if reference else None
    if amplitude.value is None or before is None:
        found = watch.judge(amplitude, point, held)
        is_unknown = amplitude.value is None or found.suppressed_by is not None
        return found if is_unknown else unknown(NO_REFERENCE)
    phase = readings[f"order1_{place}_phase_deg"]
    change = OrderVector(amplitude.value, phase.value).change_um_pk(before)
    has_phase = phase.value is not None and before.phase_deg is not None
    quality = worst((amplitude.quality, phase.quality)) if has_phase else amplitude.quality
    found = watch.judge(Reading(change, quality), point, held)
    if has_phase or not found.is_known:
        return found
    if before.phase_deg is not None and (found.level or 0) < (held or 0):
        return unknown(NO_PHASE)
    return replace(found, reason=AMPLITUDE_ONLY.get(found.reason, found.reason))
