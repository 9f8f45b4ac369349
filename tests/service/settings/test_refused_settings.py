"""Settings and limits that cannot be meant are refused, with what is wrong about them."""

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
)
from service.settings.plant import DynamicModel
from service.settings.transducers import HighPassSettings, ResonanceSettings

HIGH_PASS, RESONANCE = {"kind": "high_pass"}, {"kind": "resonance"}
ABOVE_0, NOT_BELOW_0 = "greater than 0", "greater than or equal to 0"


@pytest.mark.parametrize(
    ("model", "wrong", "said"),
    [
        (AmplitudeLimitSettings, {}, "one of alert and danger must be given"),
        (BaselineModel, {"attitude_width_deg": 7.0}, "must divide 360"),
        (BaselineModel, {"eccentricity_width": 0.0}, "equal to 0.005"),
        (BaselineModel, {"max_surface_std": -1.0}, ABOVE_0),
        (BaselineModel, {"min_days": 0}, "greater than or equal to 1"),
        (BearingSettings, {"thermal_growth_um": -1.0}, NOT_BELOW_0),
        (ChangeLimitSettings, {"alert_change": 0.15}, "must be above alert_change = 0.15"),
        (ChangeLimitSettings, {"danger_change": 0.0}, ABOVE_0),
        (ChangeLimitSettings, {"deadband": 0.04}, "must be below alert_change = 0.035"),
        (ChangeLimitSettings, {"deadband": -0.01}, ABOVE_0),
        (ChangeLimitSettings, {"on_delay_h": 0.0}, ABOVE_0),
        (DynamicModel, {"band_hz": (0.0, 12.0)}, r"must be \[low, high\] with 0 < low < high"),
        (DynamicModel, {"quiet_band_hz": (25.0, 15.0)}, "with 0 < low < high"),
        (FilmAlarmSettings, {"reading_period_s": 3600.0, "time_lapse": 4.0}, "averaging time"),
        (HighPassSettings, HIGH_PASS | {"corner_hz": 1.0, "damping": 0.0}, "equal to 0.05"),
        (OperatingModel, {"settling_s": 0.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": -1.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": 0.06}, "below 0.02, full_load_above minus"),
        (OperatingModel, {"speed_hysteresis": 0.1}, "above speed_hysteresis = 0.1"),
        (ResonanceSettings, RESONANCE | {"natural_hz": -1.0, "damping": 0.1}, "equal to"),
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


def test_no_setting_takes_numbers_that_are_not_finite_or_unknown_keys() -> None:
    models = [Settings]
    for model in models:
        models += model.__subclasses__()
        assert model.model_config["allow_inf_nan"] is False, model
        assert model.model_config["extra"] == "forbid", model
    assert len(models) > 30
