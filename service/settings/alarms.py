"""Settings of alarms and captures."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings, refuse_twice
from service.settings.limits import (
    AmplitudeLimitSettings,
    DelayS,
    EccentricityLimitSettings,
    GapLimitSettings,
    PadExcessLimitSettings,
    SpanLimitSettings,
    TemperatureLimitSettings,
    VectorChangeLimitSettings,
    VelocityLimitSettings,
    ZonesSettings,
)
from service.settings.vector_references import VectorReferenceSettings


class BearingAlarmSettings(Settings):
    """Alarm limits of a bearing; a quantity without limits raises no alarm."""

    shaft_order1_um_pk: AmplitudeLimitSettings | None = None
    """Limits of the 1× amplitude of the relative shaft vibration; they apply to x and to y."""

    shaft_overall_um_pp: SpanLimitSettings | None = None
    """Limits of the relative shaft vibration, broad-band peak-to-peak; they apply to x and to y."""

    bearing_overall_mm_s_rms: VelocityLimitSettings | None = None
    """Limits of the vibration velocity of the bearing, broad-band rms; they apply to x and to y."""

    eccentricity_ratio: EccentricityLimitSettings | None = None
    """Limits of the eccentricity ratio: eccentricity of the shaft over radial clearance."""

    gap_um: GapLimitSettings | None = None
    """Upper and lower limits of the mean gap of each probe."""

    shaft_order1_change_um_pk: VectorChangeLimitSettings | None = None
    """Limits of the change of the shaft's 1× vector from its reference; they apply to x and to
    y."""

    bearing_order1_change_um_pk: VectorChangeLimitSettings | None = None
    """Limits of the change of the bearing's 1× vector from its reference; they apply to x and to
    y."""

    order1_reference: Annotated[tuple[VectorReferenceSettings, ...], Field(max_length=6)] = ()
    """Reference 1× vectors of the healthy machine, by operating state. A reference that an engineer
    sets on the running machine takes precedence in its operating state."""

    zones: ZonesSettings = ZonesSettings()
    """Evaluation zones according to ISO 20816-5."""

    oil_temperature_c: TemperatureLimitSettings | None = None
    """Limits of the oil temperature."""

    pad_temperature_excess_k: PadExcessLimitSettings | None = None
    """Limits of the temperature of the hottest pad above the mean of the pads."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(
            ("order1_reference", n, "states", m, state)
            for n, reference in enumerate(self.order1_reference)
            for m, state in enumerate(reference.states)
        )
        return self


class AlarmSettings(Settings):
    """Delays and limits of alarms that apply to all units."""

    channel_on_delay_s: DelayS = 0.5
    """Time for which a channel must be bad to raise its alarm, s, by the times of the samples."""

    slow_channel_on_delay_s: DelayS = 5.0
    """Time for which a slow channel that a limit depends on must be bad to raise its alarm, s, by
    the times of the samples."""

    channel_off_delay_s: DelayS = 10.0
    """Time for which a channel must be good again for the alarm to return, s."""

    link_lost_after_s: Annotated[float, Field(ge=1.0, le=86_400.0)] = 10.0
    """Time without samples after which the link to a device counts as lost, s."""

    clock: Literal["judged", "ignored"] = "judged"
    """Whether the clocks of the devices are compared with the clock of this host ("judged") or
    "ignored"."""

    max_clock_offset_s: Annotated[float, Field(gt=0.0, le=1e9)] = 2.0
    """Offset of a device's time stamps from the host's clock above which an alarm is raised, s; the
    offset must last for half a minute."""

    max_clock_drift_ppm: Annotated[float, Field(gt=0.0, le=1e6)] = 200.0
    """Deviation of a device's sampling rate from its nominal rate above which an alarm is raised,
    parts per million. The deviation is measured by the host's clock, is reduced by its uncertainty,
    and must last for a minute."""

    chattering_activations: Annotated[int, Field(ge=2, le=100)] = 3
    """Number of activations within chattering_window_s that make an alarm chattering; ISA-18.2
    defines 3 or more in a minute."""

    chattering_window_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 60.0
    """Time window in which activations are counted, s; an alarm that is active for a shorter time
    is fleeting."""

    store_failing_after_s: DelayS = 10.0
    """Time for which results wait for a failing store, above which an alarm is raised, s."""

    max_analysis_delay_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 5.0
    """Time for which samples wait for the analysis, above which an alarm is raised, s."""

    max_waiting_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    """Filled share of the queue from acquisition to analysis above which an alert is raised; above
    0.9 the alarm is a danger."""

    max_samples_lost_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    """Share of a unit's samples lost or refused in ten minutes above which an alarm is raised; 0.05
    is half a minute."""

    max_shelf_h: Annotated[float, Field(gt=0.0, le=8760.0)] = 24.0
    """Maximum time for which an alarm can be shelved, hours."""


class CaptureSettings(Settings):
    """Settings of captures: recordings of the samples around an alarm, in the data folder."""

    samples: Literal["kept", "not_kept"] = "kept"
    """Whether samples are "kept" or "not_kept" when an alarm of a channel, an amplitude or a
    temperature is raised."""

    pre_s: Annotated[float, Field(ge=0.0, le=600.0)] = 60.0
    """Recorded time before the alarm, s. The samples of this time are held in memory for every
    unit: 12 channels at 600 Hz take 1.7 MB a minute. If films are monitored, the time is at least
    one averaging window, as far as max_s allows, because a film alarm depends on the whole
    window."""

    post_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 120.0
    """Recorded time after the alarm, s."""

    max_s: Annotated[float, Field(ge=1.0, le=7200.0)] = 600.0
    """Maximum length of a capture, s; further alarms prolong a capture up to this length."""

    max_gb: Annotated[float, Field(gt=0.0, le=100_000.0)] = 10.0
    """Maximum total size of the captures, GB (10^9 bytes); above it the oldest captures are
    removed. Captures that evidence refers to are removed last."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.max_s < self.pre_s + self.post_s:
            raise MisfitError(
                f"must be at least pre_s + post_s = {self.pre_s + self.post_s:g} s", "max_s"
            )
        return self
