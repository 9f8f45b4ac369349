"""Settings of alarm limits, of limits by operating condition, and of ISO 20816-5 zones."""

import math
from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, ValidationError, model_validator

from core.alarms.rules import Region, States
from core.condition.operating_state import OperatingState
from service.settings.base import MisfitError, Settings, refuse_twice

DelayS = Annotated[float, Field(ge=0.0, le=86_400.0)]
"""Delay, 0 to 86400 s (one day)."""

StateName = Literal["standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"]

AT_SPEED: tuple[StateName, ...] = ("speed_no_load", "part_load", "full_load")
EVERY_STATE: tuple[StateName, ...] = ("standstill", "run_up", *AT_SPEED, "run_down")

StateNames = Annotated[tuple[StateName, ...], Field(min_length=1, max_length=6)]


def states_of(names: tuple[StateName, ...]) -> States:
    """Return the operating states with these names, which are `OperatingState` in lower case."""
    return frozenset(OperatingState[name.upper()] for name in names)


Bounds = tuple[float, float]


class RegionSettings(Settings):
    """Region of operating conditions, such as a condition cell; ranges exclude the upper end."""

    states: StateNames | None = None
    """Operating states in which these limits apply; by default `states` of the main table."""

    eccentricity_ratio: Annotated[Bounds, Field(examples=[[0.6, 0.7]])] | None = None
    """Range of the eccentricity ratio, within 0 to 5; not limited by default; example:
    [0.35, 0.4]."""

    oil_temperature_c: Annotated[Bounds, Field(examples=[[45.0, 47.5]])] | None = None
    """Range of the oil temperature, °C, within -50 to 200; not limited by default; example:
    [45.0, 47.5]."""

    attitude_deg: Annotated[Bounds, Field(examples=[[0.0, 90.0]])] | None = None
    """Range of the attitude angle, degrees, within 0 to 360; not limited by default; example:
    [0.0, 90.0]."""

    @model_validator(mode="after")
    def _check_region(self) -> Self:
        refuse_twice(("states", n, name) for n, name in enumerate(self.states or ()))
        for key, (low, high) in RANGES.items():
            bounds: Bounds | None = getattr(self, key)
            if bounds is not None and not low <= bounds[0] < bounds[1] <= high:
                raise MisfitError(
                    f"must be [low, high] with low < high, within {low:g} to {high:g}", key
                )
        return self

    def region(self, states: StateNames) -> Region:
        """Return the settings as a `Region`; ``states`` apply if the region has no states."""
        return Region(states_of(self.states or states), *(getattr(self, key) for key in RANGES))


RANGES = {
    "eccentricity_ratio": (0.0, 5.0),
    "oil_temperature_c": (-50.0, 200.0),
    "attitude_deg": (0.0, 360.0),
}
"""Range keys of a region and their allowed bounds, in the order of the fields of `Region`."""


def _refuse_overlap(tables: Sequence[RegionSettings], states: StateNames) -> None:
    """Raise `MisfitError` if two tables overlap; a table without states applies in ``states``."""
    regions = [table.region(states) for table in tables]
    for n, m in combinations(range(len(tables)), 2):
        if regions[n].overlaps(regions[m]):
            words = f"overlaps the conditions of table[{n + 1}]; change the states or a range"
            raise MisfitError(words, "table", m)


class WatchSettings(Settings):
    """Delays and latching of the alarm on one measured quantity."""

    on_delay_s: DelayS = 10.0
    """Time for which the limit must be exceeded to raise the alarm, s, by the times of the samples.
    Results are computed once per hop of the segments."""

    off_delay_s: DelayS = 30.0
    """Time for which the value must be within the limit again for the alarm to return, s."""

    latching: bool = False
    """Whether the alarm stays active after its condition has ended, until it is reset."""


class LimitTableSettings(RegionSettings):
    """Limits in one region of operating conditions; missing keys are taken from the main table."""

    alert: float | None = None
    """Alert limit in this region; by default `alert` of the main table."""

    danger: float | None = None
    """Danger limit in this region; by default `danger` of the main table."""

    alert_below: float | None = None
    """Lower alert limit in this region, where the main table may have one; by default
    `alert_below` of the main table."""

    danger_below: float | None = None
    """Lower danger limit in this region, as alert_below."""

    deadband: float | None = None
    """Deadband in this region; by default `deadband` of the main table."""


LIMITS = ("alert", "danger", "alert_below", "danger_below", "deadband")
"""Keys of the limits of a table; only some quantities have lower limits."""


class LimitSettings(WatchSettings):
    """Main table of alarm limits of a measured value; alert, danger or both must be given.

    Alert, danger and deadband have the unit that a subclass states. None means no limit.
    """

    alert: float | None
    danger: float | None
    deadband: float

    states: StateNames = AT_SPEED
    """Operating states in which the limit applies: "standstill", "run_up", "speed_no_load",
    "part_load", "full_load", "run_down". In other states the alarm is suppressed by design. The
    limit also applies while the state is unknown."""

    table: Annotated[tuple[LimitTableSettings, ...], Field(max_length=100)] = ()
    """Different limits for individual operating states or condition cells; at most 100 tables.
    While the operating condition is unknown, all tables that may apply are evaluated."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("states", n, name) for n, name in enumerate(self.states))
        self._check_limits()
        _refuse_overlap(self.table, self.states)
        for n, table in enumerate(self.table):
            try:
                self.within(table)
            except ValidationError as error:
                found = error.errors()[0]
                at, fault = found["loc"], found["msg"]
                if isinstance(misfit := found.get("ctx", {}).get("error"), MisfitError):
                    at, fault = misfit.at, str(misfit)
                raise MisfitError(fault, "table", n, *at) from None
        return self

    def within(self, table: LimitTableSettings) -> Self:
        """Return the limits of a table, completed by the keys of this main table.

        Raises `pydantic.ValidationError` if the keys contradict each other.
        """
        own = {key: getattr(self, key) for key in LIMITS if hasattr(self, key)}
        given = {key: getattr(table, key) for key in LIMITS if getattr(table, key) is not None}
        return type(self).model_validate(own | given)

    def _check_limits(self) -> None:
        alert, danger = self.alert, self.danger
        given = [limit for limit in (alert, danger) if limit is not None]
        if not given:
            raise MisfitError("at least one of alert and danger must be given", "alert")
        if alert is not None and danger is not None and alert >= danger:
            raise MisfitError(f"must be above alert = {alert:g}", "danger")
        if self.deadband >= given[0]:
            raise MisfitError(f"must be below the lowest limit, {given[0]:g}", "deadband")


class AmplitudeLimitSettings(LimitSettings):
    """Alarm limits of the 1× amplitude of a shaft; they do not replace a protection system."""

    alert: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Value above which the alarm is an alert, µm zero-to-peak; example: 150.0."""

    danger: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Value above which the alarm is a danger, µm zero-to-peak; must be above alert; example:
    250.0."""

    deadband: Annotated[float, Field(ge=0.0, le=5000.0)] = 5.0
    """Amount by which the amplitude must fall below a limit for the alarm to return, µm."""


class SpanLimitSettings(LimitSettings):
    """Alarm limits of the broad-band relative vibration of a shaft, peak-to-peak."""

    alert: Annotated[float, Field(gt=0.0, le=10_000.0)] | None = None
    """Value above which the alarm is an alert, µm peak-to-peak; example: 300.0."""

    danger: Annotated[float, Field(gt=0.0, le=10_000.0)] | None = None
    """Value above which the alarm is a danger, µm peak-to-peak; must be above alert; example:
    500.0."""

    deadband: Annotated[float, Field(ge=0.0, le=10_000.0)] = 10.0
    """Amount by which the value must fall below a limit for the alarm to return, µm."""


class VelocityLimitSettings(LimitSettings):
    """Alarm limits of the broad-band vibration velocity of a bearing."""

    alert: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Value above which the alarm is an alert, mm/s rms; example: 2.0."""

    danger: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Value above which the alarm is a danger, mm/s rms; must be above alert; example: 4.0."""

    deadband: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.1
    """Amount by which the velocity must fall below a limit for the alarm to return, mm/s."""


class EccentricityLimitSettings(LimitSettings):
    """Alarm limits of the eccentricity ratio: eccentricity of the shaft over radial clearance."""

    alert: Annotated[float, Field(gt=0.0, le=5.0)] | None = None
    """Value above which the alarm is an alert; example: 0.7."""

    danger: Annotated[float, Field(gt=0.0, le=5.0)] | None = None
    """Value above which the alarm is a danger; must be above alert; example: 0.9."""

    deadband: Annotated[float, Field(ge=0.0, le=5.0)] = 0.02
    """Amount by which the ratio must fall below a limit for the alarm to return."""


class VectorChangeLimitSettings(LimitSettings):
    """Alarm limits of the change of a 1× vector from its reference.

    Without a phase, the limits apply to the change of the 1× amplitude.
    """

    alert: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Value above which the alarm is an alert, µm zero-to-peak; example: 30.0."""

    danger: Annotated[float, Field(gt=0.0, le=5000.0)] | None = None
    """Value above which the alarm is a danger, µm zero-to-peak; must be above alert; example:
    60.0."""

    deadband: Annotated[float, Field(ge=0.0, le=5000.0)] = 2.0
    """Amount by which the change must fall below a limit for the alarm to return, µm."""


class TemperatureLimitSettings(LimitSettings):
    """Alarm limits of the oil temperature; the bearing must have the key oil_temperature."""

    alert: Annotated[float, Field(gt=0.0, le=200.0)] | None = None
    """Value above which the alarm is an alert, °C; example: 65.0."""

    danger: Annotated[float, Field(gt=0.0, le=200.0)] | None = None
    """Value above which the alarm is a danger, °C; must be above alert; example: 75.0."""

    deadband: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """Amount by which the temperature must fall below a limit for the alarm to return, K."""

    states: StateNames = EVERY_STATE
    """Operating states in which the limit applies; all states by default, because oil may also be
    too hot at standstill."""


class PadExcessLimitSettings(LimitSettings):
    """Alarm limits of the temperature of a bearing's hottest pad above the mean of its pads."""

    alert: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    """Value above which the alarm is an alert, K; example: 8.0."""

    danger: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    """Value above which the alarm is a danger, K; must be above alert; example: 15.0."""

    deadband: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5
    """Amount by which the value must fall below a limit for the alarm to return, K."""


class TwoSidedLimitSettings(LimitSettings):
    """Upper limits alert and danger, and lower limits alert_below and danger_below, of a value."""

    alert_below: float | None
    danger_below: float | None

    unit_words: ClassVar[str] = ""

    def _check_limits(self) -> None:
        named = ("danger_below", "alert_below", "alert", "danger")
        given = [(key, limit) for key in named if (limit := getattr(self, key)) is not None]
        if not given:
            keys = "alert, danger, alert_below and danger_below"
            raise MisfitError(f"at least one of {keys} must be given", "alert")
        for (lower, low), (upper, high) in pairwise(given):
            if low >= high:
                raise MisfitError(f"must be above {lower} = {low:g}", upper)
        low_side = [limit for key, limit in given if key.endswith("below")]
        high_side = [limit for key, limit in given if not key.endswith("below")]
        half_range = (high_side[0] - low_side[-1]) / 2.0 if low_side and high_side else math.inf
        if self.deadband >= half_range:
            words = f"must be below half the allowed range, {half_range:g} {self.unit_words}"
            raise MisfitError(words.rstrip(), "deadband")


GapUm = Annotated[float, Field(gt=0.0, le=10_000.0)]


class GapLimitSettings(TwoSidedLimitSettings):
    """Upper and lower alarm limits of the mean gap of each probe."""

    unit_words: ClassVar[str] = "µm"

    alert: GapUm | None = None
    """Gap above which the alarm is an alert, µm; example: 2400.0."""

    danger: GapUm | None = None
    """Gap above which the alarm is a danger, µm; must be above alert; example: 2600.0."""

    alert_below: GapUm | None = None
    """Gap below which the alarm is an alert, µm; example: 600.0."""

    danger_below: GapUm | None = None
    """Gap below which the alarm is a danger, µm; must be below alert_below; example: 400.0."""

    deadband: Annotated[float, Field(ge=0.0, le=10_000.0)] = 10.0
    """Amount by which the gap must be within a limit for the alarm to return, µm."""

    def _check_limits(self) -> None:
        super()._check_limits()
        lowest = self.alert if self.alert is not None else self.danger
        if lowest is not None and self.deadband >= lowest:
            raise MisfitError(f"must be below the lowest limit, {lowest:g} µm", "deadband")


class SlowLimitSettings(TwoSidedLimitSettings):
    """Upper and lower alarm limits of a recorded slow channel, in the unit of the channel."""

    alert: float | None = None
    """Value above which the alarm is an alert; example: 80.0."""

    danger: float | None = None
    """Value above which the alarm is a danger; must be above alert; example: 90.0."""

    alert_below: float | None = None
    """Value below which the alarm is an alert; example: 50.0."""

    danger_below: float | None = None
    """Value below which the alarm is a danger; must be below alert_below; example: 45.0."""

    deadband: Annotated[float, Field(ge=0.0)] = 0.0
    """Amount by which the value must be within a limit for the alarm to return; example: 1.0."""

    states: StateNames = EVERY_STATE
    """Operating states in which the limits apply; all states by default."""


Boundary = Annotated[float, Field(gt=0.0, le=10_000.0)]


class ZoneTableSettings(RegionSettings):
    """Zone boundaries for one region of the operating conditions."""

    states: StateNames = AT_SPEED
    """Operating states in which the boundaries apply. In a condition without a table the alarm is
    suppressed by design. While the condition is unknown, the strictest of the tables that may apply
    is used."""

    a_b: Boundary
    """Boundary between zones A and B, in the unit of the measurement."""

    b_c: Boundary
    """Boundary between zones B and C, above a_b; above this boundary the alarm is an alert."""

    c_d: Boundary
    """Boundary between zones C and D, above b_c; above this boundary the alarm is a danger."""

    deadband: Annotated[float, Field(ge=0.0, le=10_000.0)] | None = None
    """Amount by which the value must fall below a boundary to leave the zone, in the unit of the
    measurement; a twentieth of a_b by default; example: 5.0."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.b_c <= self.a_b:
            raise MisfitError(f"must be above a_b = {self.a_b:g}", "b_c")
        if self.c_d <= self.b_c:
            raise MisfitError(f"must be above b_c = {self.b_c:g}", "c_d")
        if self.deadband is not None and self.deadband >= self.b_c:
            raise MisfitError(f"must be below b_c = {self.b_c:g}", "deadband")
        return self


class ZoneSettings(WatchSettings):
    """Evaluation zones of one measured quantity."""

    table: Annotated[tuple[ZoneTableSettings, ...], Field(min_length=1, max_length=100)]
    """Tables of zone boundaries, one for each group of operating states or condition cells; at most
    100."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _refuse_overlap(self.table, AT_SPEED)
        return self


class ZonesSettings(Settings):
    """Evaluation zones by measured quantity; the boundaries of ISO 20816-5 are not built in."""

    shaft_um_pp: ZoneSettings | None = None
    """Zones of the relative shaft displacement, µm peak-to-peak, evaluated in x and in y."""

    shaft_max_um_pk: ZoneSettings | None = None
    """Zones of the maximum shaft displacement from its mean position in any direction, µm
    zero-to-peak."""

    bearing_mm_s_rms: ZoneSettings | None = None
    """Zones of the vibration velocity of the bearing housing, mm/s rms, evaluated in x and
    in y."""
