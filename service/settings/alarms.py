"""Alarms and captures in the plant file."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings

DelayS = Annotated[float, Field(ge=0.0, le=86_400.0)]
"""Seconds, at most a day."""


class _LimitSettings(Settings):
    """Limits that a value must not pass; without alert and danger nothing is watched."""

    alert: float | None
    danger: float | None
    deadband: float

    @model_validator(mode="after")
    def _check(self) -> Self:
        alert, danger = self.alert, self.danger
        given = [limit for limit in (alert, danger) if limit is not None]
        if not given:
            raise MisfitError("gives no limit: give alert, danger or both", "alert")
        if alert is not None and danger is not None and alert >= danger:
            raise MisfitError(f"must be above alert, {alert:g}", "danger")
        if self.deadband >= given[0]:
            raise MisfitError(f"must be below the lowest limit, {given[0]:g}", "deadband")
        return self


class AmplitudeLimitSettings(_LimitSettings):
    """Limits of a shaft's vibration at 1×. padwatch is no protection system: these inform."""

    alert: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Above this, µm zero-to-peak, the alarm is an alert; example: 150.0."""

    danger: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Above this, µm zero-to-peak, it is a danger; must be above alert; example: 250.0."""

    deadband: Annotated[float, Field(ge=0.0, le=5000.0)] = 5.0
    """How far below a limit the amplitude must fall for the alarm to return, µm."""

    on_delay_s: DelayS = 10.0
    """For how long the limit must be passed, seconds of the samples' time; the amplitude is known
    once a refresh."""

    off_delay_s: DelayS = 30.0
    """For how long it must be kept again for the alarm to return, s."""


class TemperatureLimitSettings(_LimitSettings):
    """Limits of an oil temperature; the bearing must name its slow channel."""

    alert: Annotated[float, Field(gt=0.0, le=200.0)] | None = None
    """Above this, °C, the alarm is an alert; example: 65.0."""

    danger: Annotated[float, Field(gt=0.0, le=200.0)] | None = None
    """Above this, °C, it is a danger; must be above alert; example: 75.0."""

    deadband: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """How far below a limit the temperature must fall for the alarm to return, K."""

    on_delay_s: DelayS = 10.0
    """For how long the limit must be passed, seconds of the samples' time."""

    off_delay_s: DelayS = 30.0
    """For how long it must be kept again for the alarm to return, s."""


class BearingAlarmSettings(Settings):
    """What raises an alarm on a bearing; nothing unless its limits are given."""

    shaft_order1_um_pk: AmplitudeLimitSettings | None = None
    """Limits of the relative shaft vibration at 1×, in x and in y each."""

    oil_temperature_c: TemperatureLimitSettings | None = None
    """Limits of the oil temperature."""


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

    max_shelf_h: Annotated[float, Field(gt=0.0, le=8760.0)] = 24.0
    """Longest time for which an alarm can be shelved at once, hours."""


class CaptureSettings(Settings):
    """Samples that are kept around an alarm, as recordings in the data folder."""

    samples: Literal["kept", "not_kept"] = "kept"
    """Whether samples are "kept" or "not_kept" when an alarm of a channel, an amplitude or a
    temperature is raised."""

    pre_s: Annotated[float, Field(ge=0.0, le=600.0)] = 60.0
    """From how long before the alarm, s; as many samples of every unit are held in memory: 12
    channels at 600 Hz take 1.7 MB a minute."""

    post_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 120.0
    """Until how long after it, s."""

    max_s: Annotated[float, Field(ge=1.0, le=7200.0)] = 600.0
    """Longest recording, s: alarms that come while one is being written prolong it up to this."""

    max_gb: Annotated[float, Field(gt=0.0, le=100_000.0)] = 10.0
    """Space of all of them together, GB (10^9 bytes); beyond it the oldest are removed."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.max_s < self.pre_s + self.post_s:
            raise MisfitError(
                f"must be at least pre_s + post_s, {self.pre_s + self.post_s:g}", "max_s"
            )
        return self
