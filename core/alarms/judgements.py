"""Judgements: what channels, 1× vectors, the device's clock and the link say about their alarms."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from core.checks.sensor_checks import MAX_CLIPPED_SHARE
from core.condition.operating_state import OperatingState
from core.limits import WITHIN, AlarmLevel, Judgement, Limits, judge, unknown
from core.quality import NOT_MEASURED, Level, Quality, Reading, Reason, missing, worst
from core.samples.blocks import DeviceClock, StampFault

COVERAGE = 1.96
"""Standard uncertainties on each side of a value that hold the truth with 95 %."""

SENSOR_FAULTS = (Reason.DEAD, Reason.STUCK, Reason.CLIPPED)
"""Faults of a channel that only a whole segment shows."""


def channel_judgement(
    quality: Quality, segment_fault: Reason | None, clipped_percent: float | None = None
) -> Judgement:
    """Whether a waveform channel is OK.

    Parameters
    ----------
    quality
        Of its newest samples.
    segment_fault
        Fault that the newest segment has shown, if any.
    clipped_percent
        Share of clipped samples of that segment, %.
    """
    fault = segment_fault if quality.level is Level.GOOD else quality.reason
    if fault is None:
        return WITHIN
    if fault is Reason.CLIPPED and clipped_percent is not None:
        limit = 100.0 * MAX_CLIPPED_SHARE
        return Judgement(AlarmLevel.ALERT, value=clipped_percent, limit=limit, reason=fault)
    return Judgement(AlarmLevel.ALERT, reason=fault)


def slow_channel_judgement(reading: Reading) -> Judgement:
    """Whether a slow channel that an alarm depends on delivers a value."""
    if reading.value is None:
        return Judgement(AlarmLevel.ALERT, reason=reading.quality.reason)
    return WITHIN


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


def stamp_judgement(fault: StampFault | None) -> Judgement:
    """Whether a device's own time stamp could be used."""
    return WITHIN if fault is None else Judgement(AlarmLevel.ALERT, reason=fault)


def link_judgement(is_connected: bool, reason: str | None) -> Judgement:
    """Whether samples of a unit arrive."""
    if is_connected:
        return WITHIN
    return Judgement(AlarmLevel.ALERT, reason=reason or "not connected")


CLOCK_READINGS = {"clock_offset": offset_reading, "clock_drift": drift_reading}
"""What is judged of a device's clock, by kind of alarm."""

NO_REFERENCE, NO_PHASE = "no_reference", "no_phase"
AMPLITUDE_ONLY = {"ok": "amplitude_change_only", "above_limit": "amplitude_change_above_limit"}
"""Reasons of a judgement without a phase."""


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
    place: str,
    reference: VectorReference | None,
    limits: Limits,
    held: AlarmLevel | None,
) -> Judgement:
    """Judge how far a 1× vector has moved from where it was when all was well.

    A crack, a loose part or a rub can turn the vector and leave its length as it was, so that the
    length of the complex difference is judged. Without a phase only the difference of the lengths
    is known, which is never more than that: it may raise an alarm, but does not clear one where the
    reference has a phase.

    Parameters
    ----------
    place
        Whose vector: "shaft_x", "shaft_y", "bearing_x" or "bearing_y".
    held
        Level of the judgement before.
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
