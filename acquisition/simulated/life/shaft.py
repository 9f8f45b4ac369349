"""Where the shaft runs in its bearings over the years, and sudden changes of that."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.bearing import LifeBearing
from acquisition.simulated.life.operation import Operation, change_rows, held, lagged, wander
from core.arrays import FloatArray, TimeArray
from core.units import NS_PER_S

DAY_NS = 86_400 * NS_PER_S


@dataclass(frozen=True)
class ConditionChange:
    """A change of condition that is no damage.

    Parameters
    ----------
    eccentricity_ratio
        Where the shaft runs meanwhile, in every bearing, with its usual wander; None as usual.
    oil_offset_c
        By how much the oil is warmer than usual while running: a failing cooler, or one valve more.
    """

    start_ns: int
    stop_ns: int
    eccentricity_ratio: float | None = None
    oil_offset_c: float = 0.0

    def holds(self, time_ns: TimeArray) -> FloatArray:
        """(n,) 1 while the change lasts, else 0."""
        return ((time_ns >= self.start_ns) & (time_ns < self.stop_ns)).astype(np.float64)


CENTRED, OUTWARD = 0.12, 0.60
WARM_C, COLD_C = 3.0, -3.0


def four_fold(
    start_ns: int, days: float = 30.0, *, stiffer: bool = True
) -> tuple[ConditionChange, ConditionChange]:
    """Let films become four times as stiff, or as soft, by condition alone.

    For `days` before `start_ns` the shaft runs near the centre in warm oil, then for as long far
    out in cold oil, or the other way round. It is 3.5 to 8 times in the direction that feels it
    most, as machines differ. Both are within what a healthy machine meets in spring and autumn; in
    midwinter the colder oil, in midsummer the warmer, may be beyond it.
    """
    first, second = (CENTRED, WARM_C), (OUTWARD, COLD_C)
    if not stiffer:
        first, second = second, first
    span_ns = round(days * DAY_NS)
    return (
        ConditionChange(start_ns - span_ns, start_ns, *first),
        ConditionChange(start_ns, start_ns + span_ns, *second),
    )


def cooling_failure(
    start_ns: int, days: float = 5.0, oil_offset_c: float = 12.0
) -> ConditionChange:
    """Oil far warmer than it ever was: a condition that no healthy history holds."""
    return ConditionChange(start_ns, start_ns + round(days * DAY_NS), oil_offset_c=oil_offset_c)


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
