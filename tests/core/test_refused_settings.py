"""Settings and limits that cannot be meant are refused, with what is wrong about them."""

import math
from collections.abc import Callable
from functools import partial

import pytest

from core.baseline.settings import BaselineSettings
from core.change.settings import ChangeLimits
from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingLimits
from core.limits import Limits
from core.machine.response import ResponseTable
from core.machine.unit import BracketDynamics
from service.settings.plant import DynamicModel

Operating = partial(OperatingLimits, rated_speed_rpm=92.3)
PAIR, ZEROS = (1.0, 2.0), (0.0, 0.0)
Sheet = partial(ResponseTable, frequency_hz=PAIR, magnitude=PAIR, phase_deg=ZEROS)


@pytest.mark.parametrize(
    ("make", "wrong", "said"),
    [
        (BaselineSettings, {"min_days": 0}, "min_days = 0 "),
        (BaselineSettings, {"bend_std": math.nan}, "bend_std = nan"),
        (BaselineSettings, {"max_surface_std": -1.0}, "max_surface_std = -1 "),
        (BaselineSettings, {"time_scales_h": (4.0, 2.0)}, r"time_scales_h = \(4.0, 2.0\)"),
        (BaselineSettings, {"time_scales_h": ()}, r"time_scales_h = \(\)"),
        (BaselineSettings, {"reading_h": math.inf}, "reading_h = inf"),
        (BracketDynamics, {"stiffness_n_per_m": math.nan}, "bracket stiffness.*nan"),
        (CellGrid, {"eccentricity_width": 0.0}, "eccentricity_width = 0 "),
        (CellGrid, {"temperature_width_c": math.nan}, "temperature_width_c = nan"),
        (CellGrid, {"attitude_width_deg": 7}, "attitude_width_deg = 7 "),
        (ChangeLimits, {"alert_change": 0.15}, "alert_change = 0.15"),
        (ChangeLimits, {"alert_change": math.nan}, "alert_change = nan"),
        (ChangeLimits, {"danger_change": 0.0}, "danger_change = 0 "),
        (ChangeLimits, {"deadband": 0.04}, "deadband = 0.04"),
        (ChangeLimits, {"deadband": -0.01}, "deadband = -0.01"),
        (ChangeLimits, {"significance": math.inf}, "significance = inf"),
        (ChangeLimits, {"on_delay_h": 0.0}, "on_delay_h = 0 "),
        (DynamicModel, {"band_hz": (0.0, 12.0)}, "must rise from above 0, got .0, 12"),
        (DynamicModel, {"quiet_band_hz": (25.0, 15.0)}, "must rise from above 0, got .25, 15"),
        (Limits, {}, "give alert, danger or both"),
        (Limits, {"alert": math.nan}, "limit nan must be a number above 0"),
        (Limits, {"danger": math.inf}, "limit inf"),
        (Limits, {"alert": 0.0}, "limit 0 must be"),
        (Limits, {"alert": -1.0}, "limit -1 must be"),
        (Limits, {"alert": 200.0, "danger": 200.0}, "alert 200 must be below danger 200"),
        (Limits, {"alert": 150.0, "deadband": 150.0}, "deadband 150 must be"),
        (Limits, {"alert": 150.0, "deadband": -1.0}, "deadband -1"),
        (Limits, {"alert": 150.0, "deadband": math.nan}, "deadband nan"),
        (Limits, {"alert_below": 0.0}, "limit 0 must be"),
        (Limits, {"alert_below": 4.0, "danger_below": 4.0}, "danger_below 4 must be below"),
        (Limits, {"alert_below": 5.0, "alert": 5.0}, "lower limit 5 must be below upper limit 5"),
        (Limits, {"alert_below": 4.0, "alert": 5.0, "deadband": 0.5}, "deadband 0.5 must be"),
        (Operating, {"rated_power_mw": 330.0, "settling_s": 0.0}, "settling_s = 0 "),
        (Operating, {"rated_power_mw": math.nan}, "rated_power_mw = nan"),
        (Operating, {"rated_power_mw": 330.0, "full_load_above": -1.0}, "full_load_above = -1 "),
        (Operating, {"rated_power_mw": 330.0, "full_load_above": 0.06}, "full_load_above = 0.06"),
        (Operating, {"rated_power_mw": 330.0, "speed_hysteresis": 0.1}, "hysteresis of 0.1"),
        (Sheet, {"frequency_hz": (1.0,), "magnitude": (1.0,), "phase_deg": (0.0,)}, "two or more"),
        (Sheet, {"magnitude": (1.0,)}, "two or more whole points"),
        (Sheet, {"frequency_hz": (0.0, 2.0)}, "above 0 Hz"),
        (Sheet, {"frequency_hz": (2.0, 1.0)}, "must rise"),
        (Sheet, {"magnitude": (0.0, 1.0)}, "above 0, got 0"),
        (Sheet, {"magnitude": (1.0, math.nan)}, "finite"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(
    make: Callable[..., object], wrong: dict[str, object], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        make(**wrong)
