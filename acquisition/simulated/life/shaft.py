"""Shaft position in the bearings over a simulated life, and changes of operating condition."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.bearing import LifeBearing
from acquisition.simulated.life.operation import (
    Operation,
    change_rows,
    held,
    lagged,
    wander,
)
from core.arrays import FloatArray, TimeArray


@dataclass(frozen=True)
class ConditionChange:
    """Temporary change of the operating condition without damage.

    Parameters
    ----------
    eccentricity_ratio
        Mean eccentricity ratio in all bearings, with the usual variation; None leaves it unchanged.
    oil_offset_c
        Additional oil temperature while running; positive for a failed cooler.
    """

    start_ns: int
    stop_ns: int
    eccentricity_ratio: float | None = None
    oil_offset_c: float = 0.0

    def holds(self, time_ns: TimeArray) -> FloatArray:
        """Return 1 during the change and 0 outside, (n,)."""
        return ((time_ns >= self.start_ns) & (time_ns < self.stop_ns)).astype(np.float64)


LEVEL_MEAN = 0.33
LEVEL_RMS = 0.14
MIN_LEVEL, MAX_LEVEL = 0.07, 0.58
LEVEL_TIME_S = 1200.0
LEVEL_INTERVAL_S = 9.0 * 86_400.0
COMMON_SHARE = 0.6
"""Correlation between the eccentricity levels of the bearings of one shaft."""

START_RMS = 0.04
LOAD_PULL = 0.05
SLOW_RMS, SLOW_TIME_S = 0.02, 4.0 * 86_400.0
FAST_RMS, FAST_TIME_S = 0.01, 2.0 * 3600.0
ACROSS_RMS, ACROSS_TIME_S = 0.010, 20.0 * 86_400.0
MIN_ECCENTRICITY, MAX_ECCENTRICITY = 0.02, 0.66
"""Limits of the eccentricity ratio of a healthy shaft."""


def draw_positions_um(
    random: np.random.Generator,
    operation: Operation,
    bearings: tuple[LifeBearing, ...],
    changes: tuple[ConditionChange, ...] = (),
) -> dict[str, FloatArray]:
    """Draw the shaft centre positions relative to the bearing centres, (2, n) by bearing id."""
    n, step_s = len(operation), operation.step_s
    which = change_rows(random, n, step_s, LEVEL_INTERVAL_S)
    common = random.standard_normal(n)
    line_rad = random.uniform(0.0, 2.0 * math.pi)
    placed = {}
    for bearing in bearings:
        own = random.standard_normal(n)
        mixed = math.sqrt(COMMON_SHARE) * common + math.sqrt(1.0 - COMMON_SHARE) * own
        usual = held(_reflected(LEVEL_MEAN + LEVEL_RMS * mixed), which)
        level = _changed(usual, operation, changes)
        level = lagged(level, np.full(n, LEVEL_TIME_S), step_s, float(level[0]))
        along = np.clip(level + _deviation(random, operation), MIN_ECCENTRICITY, MAX_ECCENTRICITY)
        across = wander(random, n, step_s, ACROSS_TIME_S, ACROSS_RMS)
        angle_rad = line_rad + math.radians(12.0) * random.standard_normal()
        placed[bearing.id] = bearing.configured_clearance_um * _turned(along, across, angle_rad)
    return placed


def _reflected(level: FloatArray) -> FloatArray:
    """Return levels reflected at both limits; clipping would accumulate them at the limits."""
    width = MAX_LEVEL - MIN_LEVEL
    return MIN_LEVEL + np.abs((level - MIN_LEVEL + width) % (2.0 * width) - width)


def _deviation(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Draw the deviation of the eccentricity ratio from its level, (n,): by starts, load, noise."""
    n, step_s = len(operation), operation.step_s
    run = np.cumsum(np.isin(np.arange(n), operation.starts)).astype(np.float64)
    by_start = held(START_RMS * random.standard_normal(n), run)
    by_load = LOAD_PULL * (operation.load - 0.5)
    slow = wander(random, n, step_s, SLOW_TIME_S, SLOW_RMS)
    fast = wander(random, n, step_s, FAST_TIME_S, FAST_RMS)
    return np.asarray(by_start + by_load + slow + fast)


def _changed(
    level: FloatArray, operation: Operation, changes: tuple[ConditionChange, ...]
) -> FloatArray:
    for change in changes:
        if change.eccentricity_ratio is not None:
            holds = change.holds(operation.time_ns) > 0.0
            level = np.where(holds, change.eccentricity_ratio, level)
    return level


def _turned(along: FloatArray, across: FloatArray, angle_rad: float) -> FloatArray:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return np.stack([cos * along - sin * across, sin * along + cos * across])
