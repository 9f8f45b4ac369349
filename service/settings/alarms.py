"""Alarms and captures in the plant file."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings, refuse_twice
from service.settings.limits import (
    AmplitudeLimitSettings,
    DelayS,
    EccentricityLimitSettings,
    GapLimitSettings,
    SpanLimitSettings,
    TemperatureLimitSettings,
    VectorChangeLimitSettings,
    VectorReferenceSettings,
    VelocityLimitSettings,
    ZonesSettings,
)


class BearingAlarmSettings(Settings):
    """What raises an alarm on a bearing; nothing unless its limits are given."""

    shaft_order1_um_pk: AmplitudeLimitSettings | None = None
    """Limits of the relative shaft vibration at 1×, in x and in y each."""

    shaft_overall_um_pp: SpanLimitSettings | None = None
    """Limits of the relative shaft vibration, broad-band peak-to-peak, in x and in y each."""

    bearing_overall_mm_s_rms: VelocityLimitSettings | None = None
    """Limits of the bearing's velocity, broad-band rms, in x and in y each."""

    eccentricity_ratio: EccentricityLimitSettings | None = None
    """Limits of the shaft's eccentricity as a share of the clearance."""

    gap_um: GapLimitSettings | None = None
    """Limits of the mean gap of each probe, above and below."""

    shaft_order1_change_um_pk: VectorChangeLimitSettings | None = None
    """Limits of how far the shaft's 1× vector may move from its reference, in x and in y each."""

    bearing_order1_change_um_pk: VectorChangeLimitSettings | None = None
    """Limits of how far the bearing's 1× vector may move, in x and in y each."""

    order1_reference: Annotated[tuple[VectorReferenceSettings, ...], Field(max_length=6)] = ()
    """Where 1× vectors are when all is well, by operating state. One that an engineer has set on
    the running machine takes precedence in its state."""

    zones: ZonesSettings = ZonesSettings()
    """Evaluation zones after ISO 20816-5."""

    oil_temperature_c: TemperatureLimitSettings | None = None
    """Limits of the oil temperature."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(
            ("order1_reference", n, "states", m, state)
            for n, reference in enumerate(self.order1_reference)
            for m, state in enumerate(reference.states)
        )
        return self


class AlarmSettings(Settings):
    """What raises an alarm on every unit."""

    channel_on_delay_s: DelayS = 0.5
    """For how long a channel must be bad, seconds of the samples' time."""

    slow_channel_on_delay_s: DelayS = 5.0
    """For how long a slow channel that a limit needs must be bad, s of the samples' time."""

    channel_off_delay_s: DelayS = 10.0
    """For how long it must be good again for the alarm to return, s."""

    link_lost_after_s: Annotated[float, Field(ge=1.0, le=86_400.0)] = 10.0
    """For how long no samples may arrive from a device, s."""

    clock: Literal["judged", "ignored"] = "judged"
    """Whether the devices' clocks are "judged" against this host's or "ignored"."""

    max_clock_offset_s: Annotated[float, Field(gt=0.0, le=1e9)] = 2.0
    """Most that a device's time stamps may be off the host's clock, s, for half a minute."""

    max_clock_drift_ppm: Annotated[float, Field(gt=0.0, le=1e6)] = 200.0
    """Most that a device may sample faster or slower than nominal by the host's clock, parts per
    million, after its uncertainty; for a minute."""

    chattering_activations: Annotated[int, Field(ge=2, le=100)] = 3
    """An alarm that is raised so often within chattering_window_s is chattering; ISA-18.2 says 3
    or more in a minute."""

    chattering_window_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 60.0
    """Within which time, s; an alarm that is active for less is fleeting."""

    store_failing_after_s: DelayS = 10.0
    """For how long results may wait for a store that does not take them, s."""

    max_analysis_delay_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 5.0
    """Longest that samples may wait for their analysis, s."""

    max_waiting_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    """Share of the queue from acquisition to analysis that may be filled; at nine tenths it is a
    danger."""

    max_samples_lost_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    """Share of a unit's samples that may get lost or be refused in ten minutes: half a minute."""

    max_shelf_h: Annotated[float, Field(gt=0.0, le=8760.0)] = 24.0
    """Longest time for which an alarm can be shelved at once, hours."""


class CaptureSettings(Settings):
    """Samples that are kept around an alarm, as recordings in the data folder."""

    samples: Literal["kept", "not_kept"] = "kept"
    """Whether samples are "kept" or "not_kept" when an alarm of a channel, an amplitude or a
    temperature is raised."""

    pre_s: Annotated[float, Field(ge=0.0, le=600.0)] = 60.0
    """From how long before the alarm, s; as many samples of every unit are held in memory: 12
    channels at 600 Hz take 1.7 MB a minute. Where films are watched, it is at least an averaging
    window, as far as max_s allows: their alarms stand on all of it."""

    post_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 120.0
    """Until how long after it, s."""

    max_s: Annotated[float, Field(ge=1.0, le=7200.0)] = 600.0
    """Longest recording, s: alarms that come while one is being written prolong it up to this."""

    max_gb: Annotated[float, Field(gt=0.0, le=100_000.0)] = 10.0
    """Space of all of them together, GB (10^9 bytes); beyond it the oldest are removed, those last
    that evidence of an alarm refers to."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.max_s < self.pre_s + self.post_s:
            raise MisfitError(
                f"must be at least pre_s + post_s, {self.pre_s + self.post_s:g}", "max_s"
            )
        return self
