"""Oil, clearance and bracket of one bearing as they warm and cool: first-order lags."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.life_bearing import LifeBearing
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.life.wander import lagged, wander
from core.arrays import FloatArray
from core.units import NS_PER_S

STANDING_TIME_FACTOR = 10.0
"""By how much slower everything cools at standstill than it warms: the oil no longer flows."""

STANDING_OIL_C = 3.0
"""Oil over water at standstill in the end: that of the hall."""

WATER_MEAN_C = 22.5
WATER_SEASON_C = 4.5
"""The Paraná at Itaipu, warmest in February."""

WARMEST_DAY = 45.0
YEAR_S = 365.25 * 86_400.0

CLOSING_RMS, CLOSING_TIME_S = 0.006, 6.0 * 86_400.0
"""Of 165 µm it is 1 µm: what a kelvin's tenth between shaft and housing does."""


@dataclass(frozen=True, eq=False)
class ThermalCourse:
    """How warm a bearing is, and what that does to its clearance; all (n,).

    Parameters
    ----------
    closing_um
        By which clearance is smaller than cold.
    opening_um
        By which pads have moved out along the diameter that the field of the generator stretches.
    """

    oil_temperature_c: FloatArray
    closing_um: FloatArray
    opening_um: FloatArray


def draw_water_c(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Temperature of the cooling water: season and weather, (n,)."""
    n, step_s = len(operation), operation.step_s
    year = (operation.time_ns / NS_PER_S - WARMEST_DAY * 86_400.0) / YEAR_S
    season = WATER_SEASON_C * np.cos(2.0 * math.pi * year)
    weather = wander(random, n, step_s, 12.0 * 86_400.0, 0.9)
    return np.asarray(WATER_MEAN_C + season + weather)


def draw_closing_share(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Draw how much of the usual closing there is: air and water reach shaft and housing apart."""
    n, step_s = len(operation), operation.step_s
    return 1.0 + wander(random, n, step_s, CLOSING_TIME_S, CLOSING_RMS)


def thermal_course(
    bearing: LifeBearing,
    operation: Operation,
    water_c: FloatArray,
    closing_share: FloatArray | float = 1.0,
    oil_offset_c: FloatArray | float = 0.0,
    initial_oil_c: float | None = None,
) -> ThermalCourse:
    """Follow a bearing from cold.

    Parameters
    ----------
    water_c : (n,)
        Of the cooling water.
    closing_share : (n,) or one number
        Of the usual difference between shaft and housing.
    oil_offset_c : (n,) or one number
        Warmer oil than usual while running, for a want of cooling.
    initial_oil_c
        By default that of the hall.
    """
    turns = operation.is_turning
    slower = np.where(turns, 1.0, STANDING_TIME_FACTOR)
    loaded = np.maximum(operation.load, 0.0)
    rise_c = bearing.oil_rise_c + bearing.oil_rise_at_load_c * loaded + oil_offset_c
    targets = (
        (water_c + np.where(turns, rise_c, STANDING_OIL_C), bearing.oil_time_s),
        (np.where(turns, closing_share * bearing.closing_um, 0.0), bearing.closing_time_s),
        (bearing.opening_um * loaded**2, bearing.opening_time_s),
    )
    cold_c = float(water_c[0]) + STANDING_OIL_C if initial_oil_c is None else initial_oil_c
    oil, closing, opening = (
        lagged(target, time_s * slower, operation.step_s, initial)
        for (target, time_s), initial in zip(targets, (cold_c, 0.0, 0.0), strict=True)
    )
    return ThermalCourse(oil, closing, opening)
