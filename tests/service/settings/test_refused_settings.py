"""Settings and limits that cannot be meant are refused, with what is wrong about them."""

import math

import pytest
from pydantic import ValidationError

from service.settings.base import Settings
from service.settings.bearings import BearingSettings
from service.settings.films import (
    BaselineModel,
    ChangeLimitSettings,
    FilmAlarmSettings,
    OperatingModel,
)
from service.settings.limits import (
    AmplitudeLimitSettings,
    GapLimitSettings,
    LimitTableSettings,
    ZoneTableSettings,
)
from service.settings.plant import DynamicModel
from service.settings.transducers import HighPassSettings, ResonanceSettings
from service.settings.units import UnitSettings

HIGH_PASS, RESONANCE = {"kind": "high_pass"}, {"kind": "resonance"}
FINITE, ABOVE_0, NOT_BELOW_0 = "finite number", "greater than 0", "greater than or equal to 0"


@pytest.mark.parametrize(
    ("model", "wrong", "said"),
    [
        (AmplitudeLimitSettings, {}, "give alert, danger or both"),
        (AmplitudeLimitSettings, {"alert": math.nan}, FINITE),
        (AmplitudeLimitSettings, {"danger": math.inf}, FINITE),
        (AmplitudeLimitSettings, {"alert": 0.0}, ABOVE_0),
        (AmplitudeLimitSettings, {"alert": -1.0}, ABOVE_0),
        (AmplitudeLimitSettings, {"alert": 200.0, "danger": 200.0}, "must be above alert, 200"),
        (AmplitudeLimitSettings, {"alert": 150.0, "deadband": 150.0}, "lowest limit, 150"),
        (AmplitudeLimitSettings, {"alert": 150.0, "deadband": -1.0}, NOT_BELOW_0),
        (AmplitudeLimitSettings, {"alert": 150.0, "deadband": math.nan}, FINITE),
        (BaselineModel, {"attitude_width_deg": 7.0}, "must divide 360"),
        (BaselineModel, {"eccentricity_width": 0.0}, "equal to 0.005"),
        (BaselineModel, {"max_surface_std": -1.0}, ABOVE_0),
        (BaselineModel, {"min_days": 0}, "greater than or equal to 1"),
        (BaselineModel, {"temperature_width_c": math.nan}, FINITE),
        (BearingSettings, {"bracket_stiffness_n_per_m": math.nan}, FINITE),
        (BearingSettings, {"clearance_um": 0.0}, "equal to 20"),
        (BearingSettings, {"clearance_um": -1.0}, "equal to 20"),
        (BearingSettings, {"clearance_um": math.nan}, FINITE),
        (BearingSettings, {"thermal_growth_um": -1.0}, NOT_BELOW_0),
        (BearingSettings, {"thermal_growth_um": math.inf}, FINITE),
        (BearingSettings, {"thermal_growth_um": math.nan}, FINITE),
        (ChangeLimitSettings, {"alert_change": 0.15}, "must be above alert_change, 0.15"),
        (ChangeLimitSettings, {"alert_change": math.nan}, FINITE),
        (ChangeLimitSettings, {"danger_change": 0.0}, ABOVE_0),
        (ChangeLimitSettings, {"deadband": 0.04}, "must be below alert_change, 0.035"),
        (ChangeLimitSettings, {"deadband": -0.01}, ABOVE_0),
        (ChangeLimitSettings, {"significance": math.inf}, FINITE),
        (ChangeLimitSettings, {"on_delay_h": 0.0}, ABOVE_0),
        (DynamicModel, {"band_hz": (0.0, 12.0)}, "must increase from above 0, got .0, 12"),
        (DynamicModel, {"quiet_band_hz": (25.0, 15.0)}, "must increase from above 0, got .25, 15"),
        (FilmAlarmSettings, {"reading_period_s": math.inf}, FINITE),
        (FilmAlarmSettings, {"reading_period_s": 3600.0, "time_lapse": 4.0}, "shortest mean"),
        (GapLimitSettings, {"alert_below": 0.0}, ABOVE_0),
        (GapLimitSettings, {"alert_below": 4.0, "danger_below": 4.0}, "above danger_below, 4"),
        (GapLimitSettings, {"alert_below": 5.0, "alert": 5.0}, "must be above alert_below, 5"),
        (
            GapLimitSettings,
            {"alert_below": 4.0, "alert": 5.0, "deadband": 0.5},
            "below half the range, 0.5",
        ),
        (HighPassSettings, HIGH_PASS | {"corner_hz": -1.0}, "equal to 0.001"),
        (HighPassSettings, HIGH_PASS | {"corner_hz": math.nan}, FINITE),
        (HighPassSettings, HIGH_PASS | {"corner_hz": math.inf}, FINITE),
        (HighPassSettings, HIGH_PASS | {"corner_hz": 1.0, "damping": 0.0}, "equal to 0.05"),
        (HighPassSettings, HIGH_PASS | {"corner_hz": 1.0, "damping": math.nan}, FINITE),
        (LimitTableSettings, {"states": ()}, "at least 1 item"),
        (LimitTableSettings, {"eccentricity_ratio": (0.4, 0.4)}, "must increase"),
        (OperatingModel, {"settling_s": 0.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": -1.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": 0.06}, "below full_load_above = 0.06"),
        (OperatingModel, {"speed_hysteresis": 0.1}, "above speed_hysteresis = 0.1"),
        (ResonanceSettings, RESONANCE | {"natural_hz": -1.0, "damping": 0.1}, "equal to"),
        (ResonanceSettings, RESONANCE | {"natural_hz": math.nan, "damping": 0.1}, FINITE),
        (ResonanceSettings, RESONANCE | {"natural_hz": 1.0, "damping": math.inf}, FINITE),
        (UnitSettings, {"rated_power_mw": math.nan}, FINITE),
        (ZoneTableSettings, {"a_b": 0.0, "b_c": 2.0, "c_d": 3.0}, ABOVE_0),
        (ZoneTableSettings, {"a_b": 2.0, "b_c": 2.0, "c_d": 3.0}, "must be above a_b, 2"),
        (ZoneTableSettings, {"a_b": 1.0, "b_c": 3.0, "c_d": 3.0}, "must be above b_c, 3"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(
    model: type[Settings], wrong: dict[str, object], said: str
) -> None:
    with pytest.raises(ValidationError) as refused:
        model.model_validate(wrong)
    keys = list(wrong)
    named = [mistake for mistake in refused.value.errors() if mistake["type"] != "missing"]
    assert len(named) == 1
    assert not named[0]["loc"] or named[0]["loc"][0] in keys
    refused.match(said)
