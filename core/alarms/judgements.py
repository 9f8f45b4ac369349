"""Alarm judgements of channel faults, changes of 1× vectors, and the device clock."""

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
"""Coverage factor of a 95 % interval of a normal distribution."""

SENSOR_FAULTS = (Reason.DEAD, Reason.STUCK, Reason.CLIPPED)
"""Channel faults that can be detected only from a whole segment."""


def fault_judgement(fault: str | None) -> Judgement:
    """Return an alert whose reason is the fault; without a fault, a judgement within limits."""
    return WITHIN if fault is None else Judgement(AlarmLevel.ALERT, reason=fault)


def channel_judgement(
    quality: Quality, segment_fault: Reason | None, clipped_percent: float | None = None
) -> Judgement:
    """Return the judgement of a waveform channel: an alert if samples or segments show a fault.

    Parameters
    ----------
    quality
        Quality of the newest samples.
    segment_fault
        Fault detected from segments, or None; used if the newest samples are good.
    clipped_percent
        Percentage of clipped samples in the newest segment, which is the value of an alert for
        clipping; None if no sample is clipped, or if the percentage is unknown.
    """
    fault = segment_fault if quality.level is Level.GOOD else quality.reason
    found = fault_judgement(fault)
    if fault is not Reason.CLIPPED or clipped_percent is None:
        return found
    return replace(found, value=clipped_percent, limit=100.0 * MAX_CLIPPED_SHARE)


def fault_after_segment(
    fault: Reason | None, amplitude: Reading, has_wrong_sign: bool | None
) -> Reason | None:
    """Return the fault of a channel after a new segment: kept, newly detected, or None if cleared.

    Parameters
    ----------
    fault
        Fault before the segment, or None.
    amplitude
        1× amplitude of the channel in that segment.
    has_wrong_sign
        Whether the stiffness in this direction indicates reversed polarity; None if unknown.
    """
    if amplitude.value is None and amplitude.quality.reason in SENSOR_FAULTS:
        return amplitude.quality.reason
    if amplitude.value is not None and fault in SENSOR_FAULTS:
        fault = None
    if has_wrong_sign is False and fault is Reason.POLARITY:
        return None
    return Reason.POLARITY if has_wrong_sign and fault is None else fault


def film_judgement(found: Mapping[str, Judgement], held: Judgement) -> Judgement:
    """Return the judgement of a film, combined from the judgements `found` of directions x and y.

    `held` is the last judgement of the film. If a known direction exceeds its limit, value, limit
    and reason are those of the known direction with the highest level or, at equal levels, the
    largest change; the level is not below that of `held` while a direction of `held` is unknown.
    If none does, the result is unknown while a direction of `held` is unknown or, if `held` has no
    level, while any direction is unknown.
    """
    known = {axis: each for axis, each in found.items() if each.is_known}
    unjudged = [each for axis, each in found.items() if axis not in known]
    open_axes = [axis for axis in held.directions if axis not in known]
    over = [axis for axis in known if known[axis].level is not None]
    if not over and unjudged and (open_axes or held.level is None):
        return unjudged[0]
    worst = max(known.values(), key=lambda each: (each.level or 0, abs(each.value or 0.0)))
    if not over:
        return worst
    levels = filter(None, (worst.level, held.level if open_axes else None))
    return replace(worst, level=max(levels), directions="".join(sorted({*over, *open_axes})))


def offset_reading(clock: DeviceClock | None) -> Reading:
    """Return the absolute offset, in s, of the device clock from host time; bad if unknown."""
    if clock is None or clock.offset_s is None:
        return NOT_MEASURED
    return Reading(abs(clock.offset_s))


def drift_reading(clock: DeviceClock | None) -> Reading:
    """Return the excess, in ppm, of the absolute sampling-rate drift over its 95 % uncertainty.

    The reading is 0 without an excess, and bad if the drift or its uncertainty is unknown.
    """
    if clock is None or clock.drift_ppm is None or clock.u_drift_ppm is None:
        return missing(Reason.WAITING_FOR_DATA)
    return Reading(max(0.0, abs(clock.drift_ppm) - COVERAGE * clock.u_drift_ppm))


CLOCK_READINGS = {"clock_offset": offset_reading, "clock_drift": drift_reading}
"""Functions that return the monitored reading of the device clock, by name of the alarm rule."""

NO_REFERENCE, NO_PHASE = "no_reference", "no_phase"
AMPLITUDE_ONLY = {"ok": "amplitude_change_only", "above_limit": "amplitude_change_above_limit"}
"""Reason code for a judgement by amplitude only, by reason code of a judgement with phase."""


@dataclass(frozen=True)
class OrderVector:
    """1× vibration vector: amplitude, and phase lead over the key-phase pulse (None if unknown).

    Raises ValueError if the amplitude is negative or not finite, or the phase is not finite.
    """

    amplitude_um_pk: float
    phase_deg: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.amplitude_um_pk) and self.amplitude_um_pk >= 0.0):
            raise ValueError(f"1× amplitude must be a number >= 0, got {self.amplitude_um_pk:g} µm")
        if self.phase_deg is not None and not math.isfinite(self.phase_deg):
            raise ValueError(f"1× phase must be a number of degrees, got {self.phase_deg:g}")

    def change_um_pk(self, other: "OrderVector") -> float:
        """Return the length of the difference between this vector and another, in µm 0-pk.

        If a phase is None, return the absolute difference of the amplitudes instead.
        """
        if self.phase_deg is None or other.phase_deg is None:
            return abs(self.amplitude_um_pk - other.amplitude_um_pk)
        return abs(self.phasor_um_pk - other.phasor_um_pk)

    @property
    def phasor_um_pk(self) -> complex:
        """Complex phasor in µm 0-pk; an unknown phase counts as 0."""
        return cmath.rect(self.amplitude_um_pk, math.radians(self.phase_deg or 0.0))


@dataclass(frozen=True)
class VectorReference:
    """Reference 1× vectors of a healthy bearing in one operating state.

    `vectors` contains the known vectors by measuring point: "shaft_x", "shaft_y", "bearing_x",
    "bearing_y".
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
    """Return the judgement of the change of a 1× vector from its reference.

    A crack, a loose part or a rub can turn the vector without a change of its amplitude, so the
    length of the complex difference is judged. Without a phase, only the amplitude difference is
    known. It is never larger than that length, so it can raise an alarm but not clear an alarm
    whose reference has a phase. The judgement is unknown without an amplitude or a reference.
    `watch.source` is the measuring point ("shaft_x"); `held` is the level of the last judgement.
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
