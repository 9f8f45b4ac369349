"""When a unit runs and at what load: weeks of base load, of two shifts, of reserve; outages."""

import math

import numpy as np

from acquisition.simulated.life.held_load import HeldLoad
from acquisition.simulated.life.operation import RATED_POWER_MW, STEP_S, Operation
from acquisition.simulated.life.wander import wander
from core.arrays import FloatArray, TimeArray
from core.units import NS_PER_S

STEPS_PER_DAY = int(86_400.0 / STEP_S)
STEPS_PER_HOUR = STEPS_PER_DAY // 24
YEAR_DAYS = 365.25
DAY_NS = 86_400 * NS_PER_S

BASE, TWO_SHIFT, WEEKDAYS, RESERVE = range(4)
WET_SHARES = (0.72, 0.20, 0.06, 0.02)
DRY_SHARES = (0.40, 0.36, 0.18, 0.06)
"""How often a week is of each kind."""

LOAD_EDGES_H = (0, 6, 9, 12, 17, 22, 24)
LOAD_RANGES = (
    ((0.6, 1.0), (0.8, 1.0), (0.94, 1.0), (0.92, 1.0), (0.95, 1.0), (0.75, 1.0)),
    ((0.5, 0.7), (0.6, 0.95), (0.75, 1.0), (0.7, 1.0), (0.9, 1.0), (0.5, 0.8)),
    ((0.6, 0.9), (0.7, 0.95), (0.8, 1.0), (0.8, 1.0), (0.9, 1.0), (0.7, 0.95)),
    ((0.5, 0.7), (0.5, 0.8), (0.6, 0.9), (0.6, 0.9), (0.7, 1.0), (0.5, 0.7)),
)
"""Share of rated power over the day, by kind of week."""

OUTAGE_BEGINS_DAY = (130.0, 270.0)
OUTAGE_DAYS = (12.0, 26.0)
TRIPS_PER_YEAR = 5.0
TRIP_H = (2.0, 40.0)
LONG_NO_LOAD_SHARE = 0.03
"""Of starts: tests and warm-ups at speed without load, 3 to 8 h instead of 10 to 30 min."""

RUN_UP_SHARE = 0.3
"""Of starts: those in which a reading falls into the three minutes of the run-up."""


def draw_operation(
    random: np.random.Generator,
    time_ns: TimeArray,
    rated_speed_rpm: float,
    held: HeldLoad | None = None,
) -> Operation:
    """Draw how a unit is run, on a grid of 10 min; its first row counts as midnight."""
    first_day = int(time_ns[0] // DAY_NS)
    n_weeks = math.ceil(time_ns.size / STEPS_PER_DAY / 7)
    load = np.concatenate([_week(random, first_day + 7 * week) for week in range(n_weeks)])
    load = load[: time_ns.size]
    _stop_for_outages(random, load, first_day % YEAR_DAYS)
    _trip(random, load)
    speed = np.where(load > 0.0, 1.0, 0.0)
    _start(random, load, speed)
    if held is not None:  # after all that is drawn by chance, which stays what it was before
        load[time_ns >= held.from_ns], speed[time_ns >= held.from_ns] = held.load, 1.0
    speed *= 1.0 + wander(random, load.size, STEP_S, 1800.0, 3e-4)
    power_mw = RATED_POWER_MW * np.maximum(load, 0.0)
    power_mw[load > 0.0] += 3.0 * random.standard_normal(int(np.sum(load > 0.0)))
    return Operation(time_ns, rated_speed_rpm * speed, power_mw, rated_speed_rpm)


def _week(random: np.random.Generator, day: int) -> FloatArray:
    """Share of rated power through one week; 0 is standstill."""
    wetness = 0.5 + 0.5 * math.cos(2.0 * math.pi * (day - 30) / YEAR_DAYS)
    shares = wetness * np.array(WET_SHARES) + (1.0 - wetness) * np.array(DRY_SHARES)
    kind = int(random.choice(4, p=shares))
    load = np.stack([_day(random, kind) for _ in range(7)])
    if kind == WEEKDAYS:
        load[5:] = 0.0
    if kind == RESERVE:
        load[random.random(7) < 0.7] = 0.0
    return load.ravel()


def _day(random: np.random.Generator, kind: int) -> FloatArray:
    levels = [random.uniform(*limits) for limits in LOAD_RANGES[kind]]
    hours = np.diff(LOAD_EDGES_H)
    load = np.repeat(levels, STEPS_PER_HOUR * hours)
    load = np.minimum(load + wander(random, load.size, STEP_S, 1800.0, 0.01), 1.0)
    if kind in (TWO_SHIFT, RESERVE):
        load[: int(random.uniform(5.0, 7.0) * STEPS_PER_HOUR)] = 0.0
        load[STEPS_PER_DAY - int(random.uniform(0.5, 2.0) * STEPS_PER_HOUR) :] = 0.0
    return load


def _stop_for_outages(random: np.random.Generator, load: FloatArray, first_day: float) -> None:
    """One long outage a year, in the dry season."""
    for year in range(math.ceil(load.size / STEPS_PER_DAY / YEAR_DAYS) + 1):
        day = year * YEAR_DAYS - first_day + random.uniform(*OUTAGE_BEGINS_DAY)
        steps = int(random.uniform(*OUTAGE_DAYS) * STEPS_PER_DAY)
        first = int(day * STEPS_PER_DAY)
        load[max(first, 0) : max(first + steps, 0)] = 0.0


def _trip(random: np.random.Generator, load: FloatArray) -> None:
    years = load.size / STEPS_PER_DAY / YEAR_DAYS
    for first in random.integers(0, load.size, random.poisson(TRIPS_PER_YEAR * years)):
        load[first : first + int(random.uniform(*TRIP_H) * STEPS_PER_HOUR)] = 0.0


def _start(random: np.random.Generator, load: FloatArray, speed: FloatArray) -> None:
    """Let every start pass through speed without load, and some show the run-up itself."""
    for first in np.flatnonzero(np.diff((load > 0.0).astype(np.int8), prepend=np.int8(0)) == 1):
        is_long = random.random() < LONG_NO_LOAD_SHARE
        steps = random.integers(18, 49) if is_long else random.integers(1, 4)
        running = load[first : first + steps] > 0.0
        load[first : first + steps][running] = -1.0  # turning without load
        if random.random() < RUN_UP_SHARE:
            speed[first] = random.uniform(0.25, 0.9)
