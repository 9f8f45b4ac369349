"""Where the shaft runs in its bearings over the years, for reasons nobody explains.

Brito et al. find the shaft elsewhere in each of ten measurements within nine months (Figure 2), and
moving along lines of similar direction in the three bearings (Figure 9): here it moves along one
line per machine, by levels that stay for days, by every start, by load and by slow wander, and a
little across that line. A rigid shaft in three bearings is not placed by its load alone, so
position is drawn and the load on the pads follows from it.
"""

import math

import numpy as np

from acquisition.simulated.life.condition_change import ConditionChange
from acquisition.simulated.life.life_bearing import LifeBearing
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.life.wander import change_rows, held, lagged, wander
from core.arrays import FloatArray

LEVEL_MEAN = 0.33
LEVEL_RMS = 0.14
LEVEL_LEAST, LEVEL_MOST = 0.07, 0.58
LEVEL_TIME_S = 1200.0
LEVEL_INTERVAL_S = 9.0 * 86_400.0
COMMON_SHARE = 0.6
"""Correlation of the levels of the three bearings of one shaft."""

START_RMS = 0.04
LOAD_PULL = 0.05
SLOW_RMS, SLOW_TIME_S = 0.02, 4.0 * 86_400.0
FAST_RMS, FAST_TIME_S = 0.01, 2.0 * 3600.0
ACROSS_RMS, ACROSS_TIME_S = 0.010, 20.0 * 86_400.0
LEAST, MOST = 0.02, 0.66
"""Eccentricity ratios within which a healthy shaft stays."""


def draw_positions_um(
    random: np.random.Generator,
    operation: Operation,
    bearings: tuple[LifeBearing, ...],
    changes: tuple[ConditionChange, ...] = (),
) -> dict[str, FloatArray]:
    """Draw the shaft's mean position from the bearing's centre, (2, n) by bearing."""
    n, step_s = len(operation), operation.step_s
    which = change_rows(random, n, step_s, LEVEL_INTERVAL_S)
    common = random.standard_normal(n)
    line_rad = random.uniform(0.0, 2.0 * math.pi)
    placed = {}
    for bearing in bearings:
        own = random.standard_normal(n)
        mixed = math.sqrt(COMMON_SHARE) * common + math.sqrt(1.0 - COMMON_SHARE) * own
        level = _changed(held(_folded(LEVEL_MEAN + LEVEL_RMS * mixed), which), operation, changes)
        level = lagged(level, np.full(n, LEVEL_TIME_S), step_s, float(level[0]))
        along = np.clip(level + _unrest(random, operation), LEAST, MOST)
        across = wander(random, n, step_s, ACROSS_TIME_S, ACROSS_RMS)
        angle_rad = line_rad + math.radians(12.0) * random.standard_normal()
        placed[bearing.id] = bearing.told_clearance_um * _turned(along, across, angle_rad)
    return placed


def _folded(level: FloatArray) -> FloatArray:
    """Levels reflected at both limits, so that none piles up there."""
    width = LEVEL_MOST - LEVEL_LEAST
    return LEVEL_LEAST + np.abs((level - LEVEL_LEAST + width) % (2.0 * width) - width)


def _unrest(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Departure from the level by starts, load and wander."""
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
