"""Conditions that are not a value above a limit: a channel, a device's clock, a link."""

from core.checks.sensor_checks import MAX_CLIPPED_SHARE
from core.limits import WITHIN, AlarmLevel, Condition
from core.quality import Level, Quality, Reading, Reason, missing
from core.samples.device_clock import DeviceClock, StampFault

COVERAGE = 1.96
"""Standard uncertainties on each side of a value that hold the truth with 95 %."""

NO_CLOCK, NO_DRIFT = missing(Reason.NOT_MEASURED), missing(Reason.WAITING_FOR_DATA)

SENSOR_FAULTS = (Reason.DEAD, Reason.STUCK, Reason.CLIPPED)
"""What only a whole segment shows of a channel."""


def channel_condition(
    quality: Quality, segment_fault: Reason | None, clipped_percent: float | None = None
) -> Condition:
    """Whether a waveform channel may be believed.

    Parameters
    ----------
    quality
        Of its newest samples.
    segment_fault
        What the newest segment has shown, if anything.
    clipped_percent
        Of the samples of that segment.
    """
    fault = segment_fault if quality.level is Level.GOOD else quality.reason
    if fault is None:
        return WITHIN
    if fault is Reason.CLIPPED and clipped_percent is not None:
        limit = 100.0 * MAX_CLIPPED_SHARE
        return Condition(AlarmLevel.ALERT, value=clipped_percent, limit=limit, reason=fault)
    return Condition(AlarmLevel.ALERT, reason=fault)


def slow_channel_condition(reading: Reading) -> Condition:
    """Whether a slow channel that an alarm depends on delivers a value."""
    if reading.value is None:
        return Condition(AlarmLevel.ALERT, reason=reading.quality.reason)
    return WITHIN


def offset_reading(clock: DeviceClock | None) -> Reading:
    """How far a device's time stamps are off the host's clock, s, either way."""
    if clock is None or clock.offset_s is None:
        return NO_CLOCK
    return Reading(abs(clock.offset_s))


def drift_reading(clock: DeviceClock | None) -> Reading:
    """How much a device surely samples faster or slower than it says, parts per million."""
    if clock is None or clock.drift_ppm is None or clock.u_drift_ppm is None:
        return NO_DRIFT
    return Reading(max(0.0, abs(clock.drift_ppm) - COVERAGE * clock.u_drift_ppm))


def stamp_condition(fault: StampFault | None) -> Condition:
    """Whether a device's own time stamp could be used."""
    return WITHIN if fault is None else Condition(AlarmLevel.ALERT, reason=fault)


def link_condition(is_connected: bool, reason: str | None) -> Condition:
    """Whether samples of a unit arrive."""
    if is_connected:
        return WITHIN
    return Condition(AlarmLevel.ALERT, reason=reason or "not connected")
