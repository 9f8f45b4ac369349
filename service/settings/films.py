"""Settings of film monitoring: operating states, baselines and limits of stiffness change."""

from dataclasses import asdict
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from core.baseline.history import QUANTITIES
from core.baseline.settings import BaselineSettings
from core.change.settings import CK_CHANGE, ChangeLimits
from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from service.settings.base import MisfitError, Settings, Share


class ChangeLimitSettings(Settings):
    """Magnitude, significance and duration of a stiffness change that raises an alarm."""

    alert_change: Share = ChangeLimits.alert_change
    """Limit of a stiffness increase or decrease, as a fraction of the expected stiffness (0.035 is
    3.5 %). A change that exceeds the limit by one standard uncertainty is an alert."""

    danger_change: Share = ChangeLimits.danger_change
    """Limit of a stiffness change, as alert_change; a change that exceeds the limit by three
    standard uncertainties is a danger. Must be above alert_change; example: 0.15."""

    deadband: Share = ChangeLimits.deadband
    """Fraction of the expected stiffness by which a change must fall below its limit for the alarm
    level to end; example: 0.01."""

    significance: Annotated[float, Field(gt=0.0, le=100.0)] = ChangeLimits.significance
    """Minimum ratio of the mean change to its standard uncertainty for an alarm, for a mean over
    four running hours."""

    significance_fall: Annotated[float, Field(gt=0.0, le=10.0)] = ChangeLimits.significance_fall
    """Reduction of the ratio `significance` for each fourfold increase of the averaging time."""

    min_evidence_h: Annotated[float, Field(gt=0.0, le=1000.0)] = ChangeLimits.min_evidence_h
    """Running hours with a baseline after which a film can be classified as normal."""

    on_delay_h: Annotated[float, Field(gt=0.0, le=1000.0)] = ChangeLimits.on_delay_h
    """Running hours for which a change must last to raise an alarm."""

    off_delay_h: Annotated[float, Field(gt=0.0, le=1000.0)] = ChangeLimits.off_delay_h
    """Running hours without a change after which the alarm returns."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.alert_change >= self.danger_change:
            raise MisfitError(
                f"must be above alert_change = {self.alert_change:g}", "danger_change"
            )
        if self.deadband >= self.alert_change:
            raise MisfitError(f"must be below alert_change = {self.alert_change:g}", "deadband")
        return self

    def limits(self) -> ChangeLimits:
        """Return the settings as `ChangeLimits`."""
        return ChangeLimits(**self.model_dump())


class BaselineModel(Settings):
    """Settings of condition cells, and requirements for learning a baseline."""

    eccentricity_width: Annotated[float, Field(ge=0.005, le=0.5)] = CellGrid.eccentricity_width
    """Width of a condition cell in eccentricity ratio; example: 0.05."""

    temperature_width_c: Annotated[float, Field(ge=0.1, le=50.0)] = CellGrid.temperature_width_c
    """Width of a condition cell in oil temperature, K; example: 2.5."""

    attitude_width_deg: Annotated[float, Field(ge=1.0, le=360.0)] | None = None
    """Width of a condition cell in attitude angle, degrees, a divisor of 360; by default cells do
    not depend on the attitude angle; example: 45.0."""

    uses_attitude: bool = BaselineSettings.uses_attitude
    """Whether the baseline depends on the attitude angle."""

    min_readings: Annotated[int, Field(ge=1, le=100_000)] = BaselineSettings.min_readings
    """Minimum number of readings in a condition cell for the baseline to apply there without
    support by neighbouring cells."""

    min_days: Annotated[int, Field(ge=1, le=1000)] = BaselineSettings.min_days
    """Minimum number of days with readings in a condition cell for the baseline to apply there
    without support by neighbouring cells."""

    min_learning_days: Annotated[int, Field(ge=1, le=3650)] = BaselineSettings.min_learning_days
    """Minimum number of days with readings before the first baseline."""

    max_surface_std: Annotated[float, Field(gt=0.0, le=1.0)] = BaselineSettings.max_surface_std
    """Standard uncertainty of the expected stiffness, as a natural logarithm, above which the
    baseline does not apply to an operating condition."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        turn = 360.0 / (self.attitude_width_deg or 360.0)
        if abs(turn - round(turn)) > 1e-9:
            raise MisfitError("must divide 360 without remainder", "attitude_width_deg")
        return self

    def settings(self, reading_h: float = BaselineSettings.reading_h) -> BaselineSettings:
        """Return the settings as `BaselineSettings`, for a reading every ``reading_h`` hours."""
        rest = self.model_dump(exclude=set(GRID_KEYS))
        grid = CellGrid(*(getattr(self, key) for key in GRID_KEYS))
        return BaselineSettings(grid=grid, reading_h=reading_h, **rest)


GRID_KEYS = ("eccentricity_width", "temperature_width_c", "attitude_width_deg")
"""Keys of the widths of a condition cell, in the order of the fields of `CellGrid`."""


class OperatingModel(Settings):
    """Limits of the operating states, as shares of rated speed and power."""

    standing_below: Share = OperatingLimits.standing_below
    """Share of the rated speed below which a unit is at standstill."""

    at_speed_above: Share = OperatingLimits.at_speed_above
    """Share of the rated speed above which a unit is at speed."""

    loaded_above: Share = OperatingLimits.loaded_above
    """Share of the rated power above which a unit is at part load."""

    full_load_above: Share = OperatingLimits.full_load_above
    """Share of the rated power above which a unit is at full load."""

    speed_hysteresis: Share = OperatingLimits.speed_hysteresis
    """Hysteresis of the speed limits, as a share of the rated speed."""

    power_hysteresis: Share = OperatingLimits.power_hysteresis
    """Hysteresis of the power limits, as a share of the rated power."""

    settling_s: Annotated[float, Field(gt=0.0, le=86_400.0)] = OperatingLimits.settling_s
    """Time in one operating state before films are compared with their baselines, s."""

    oil_band_c: Annotated[float, Field(gt=0.0, le=50.0)] = OperatingLimits.oil_band_c
    """Width of a temperature band, K, at least the resolution of the sensor. After a start, a
    bearing is warm once its oil temperature has stayed within such a band for `oil_settling_s` at
    speed. Example: 0.5."""

    oil_settling_s: Annotated[float, Field(gt=0.0, le=604_800.0)] = OperatingLimits.oil_settling_s
    """Time for which the oil temperature must stay within `oil_band_c`, s. After a start clearances
    decrease for hours, longer than the oil temperature rises; example: 7200."""

    warm_up_s: Annotated[float, Field(gt=0.0, le=604_800.0)] = OperatingLimits.warm_up_s
    """Time at speed after which films are compared with their baselines even if the oil temperature
    changes, s; example: 21600."""

    longest_gap_s: Annotated[float, Field(gt=0.0, le=604_800.0)] = OperatingLimits.longest_gap_s
    """Time without results after which the operating state is unknown, s."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for lower, upper, band in BANDS:
            low, high, width = (getattr(self, key) for key in (lower, upper, band))
            if not (width < low and low + width < high - width):
                limits = f"must be above {band} = {width:g} and below {high - 2 * width:g}"
                raise MisfitError(f"{limits}, {upper} minus twice {band}", lower)
        return self

    def limits(self, rated_speed_rpm: float, rated_power_mw: float) -> OperatingLimits:
        """Return the settings as `OperatingLimits` of a machine with this rated speed and power."""
        return OperatingLimits(rated_speed_rpm, rated_power_mw, **self.model_dump())


BANDS = (
    ("standing_below", "at_speed_above", "speed_hysteresis"),
    ("loaded_above", "full_load_above", "power_hysteresis"),
)


class FilmAlarmSettings(Settings):
    """Settings of stiffness baselines by condition, and of alarms of stiffness change."""

    reading_period_s: Annotated[float, Field(ge=1.0, le=3600.0)] = 600.0
    """Interval between film readings, s; should be at least the averaging time, so that readings
    are independent."""

    time_lapse: Annotated[float, Field(ge=1.0, le=1000.0)] = 1.0
    """Factor by which running hours are accelerated, for demonstrations only."""

    learning_days: Annotated[float, Field(ge=1.0, le=3650.0)] = 365.0
    """Learning period of a baseline after the first reading or a machine event, days. The period
    should include all seasons. Afterwards the baseline is fixed until an engineer renews it."""

    learn_every_days: Annotated[float, Field(ge=0.01, le=365.0)] = 7.0
    """Interval of learning within the learning period, days."""

    acceptance: Literal["automatic", "by_engineer"] = "automatic"
    """Acceptance of a learned baseline: "automatic" if the baseline agrees with the first accepted
    baseline and the film has not drifted, or only "by_engineer"."""

    latching: bool = False
    """Whether an alarm stays active after the stiffness change has ended, until it is reset."""

    change: ChangeLimitSettings = ChangeLimitSettings()
    """Limits of stiffness change."""

    change_ck: ChangeLimitSettings = ChangeLimitSettings(**asdict(CK_CHANGE))
    """Limits of the change of damping over stiffness, c/k, of the estimator `dynamic`; fractions
    of the expected c/k. A change of clearance moves c/k by about a third of its size, a change of
    the oil does not."""

    baseline: BaselineModel = BaselineModel()
    """Condition cells and learning of the baselines."""

    operating: OperatingModel = OperatingModel()
    """Limits of the operating states."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        shortest_s = 3600.0 * BaselineSettings().time_scales_h[0] / self.time_lapse
        if self.reading_period_s >= shortest_s:
            raise MisfitError(
                f"must be below {shortest_s:g} s, the shortest averaging time", "reading_period_s"
            )
        return self

    def alert_change(self, quantity: str) -> float:
        """Return the alert limit of one of the `QUANTITIES`, as a fraction of the baseline."""
        is_stiffness = QUANTITIES[quantity].value == "ln_k"
        return (self.change if is_stiffness else self.change_ck).alert_change

    @property
    def reading_h(self) -> float:
        """Interval between film readings, in running hours."""
        return self.reading_period_s * self.time_lapse / 3600.0
