"""Operation of a unit over years: running times, load and speed; random processes."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.units import NS_PER_S

RATED_POWER_MW = 700.0
STEP_S = 600.0
DAY_S = 86_400.0
DAY_NS = 86_400 * NS_PER_S
YEAR_DAYS = 365.25
YEAR_S = YEAR_DAYS * DAY_S


@dataclass(frozen=True, eq=False)
class Operation:
    """Time series of speed and power of a unit at the times `time_ns`; all (n,)."""

    time_ns: TimeArray
    speed_rpm: FloatArray
    power_mw: FloatArray
    rated_speed_rpm: float
    rated_power_mw: float = RATED_POWER_MW

    def __len__(self) -> int:
        return int(self.time_ns.size)

    @property
    def step_s(self) -> float:
        """Time between the first two rows, s."""
        return float(self.time_ns[1] - self.time_ns[0]) / NS_PER_S

    @property
    def load(self) -> FloatArray:
        """Power as a share of rated power, (n,)."""
        return self.power_mw / self.rated_power_mw

    @property
    def is_turning(self) -> npt.NDArray[np.bool_]:
        """Whether the shaft turns, (n,)."""
        return self.speed_rpm > 0.0

    @property
    def is_at_speed(self) -> npt.NDArray[np.bool_]:
        """Whether the shaft has rated speed, which excludes run-ups, (n,)."""
        return self.speed_rpm > 0.95 * self.rated_speed_rpm

    @property
    def starts(self) -> npt.NDArray[np.int64]:
        """Indices of the first row of each run, (n_runs,)."""
        return np.flatnonzero(np.diff(self.is_turning.astype(np.int8), prepend=np.int8(0)) == 1)


def time_grid_ns(start_ns: int, years: float, step_s: float = STEP_S) -> TimeArray:
    """Return evenly spaced times of the readings over `years` of 365.25 days, (n,).

    Raises ValueError if `years` is less than a day.
    """
    n = int(years * YEAR_S / step_s)
    if not n * step_s >= DAY_S:
        raise ValueError(f"years must be at least 1/365 (one day), got {years:g}")
    return start_ns + np.arange(n, dtype=np.int64) * np.int64(step_s * NS_PER_S)


@dataclass(frozen=True)
class HeldLoad:
    """Operation at constant load in some hours of each day, from the time `from_ns`.

    Earlier operation is unchanged. `load` is a share of rated power; `hours` are pairs of begin and
    end, by default the whole day. Raises `ValueError` if the load is not above 0, or is above 1.
    """

    from_ns: int
    load: float
    hours: tuple[tuple[float, float], ...] = ((0.0, 24.0),)

    def __post_init__(self) -> None:
        if not 0.0 < self.load <= 1.0:
            raise ValueError(f"load = {self.load:g} must be above 0 and at most 1")


def wander(
    random: np.random.Generator, n: int, step_s: float, time_s: float, rms: float
) -> FloatArray:
    """Draw a stationary Gauss-Markov process with mean 0 and the given rms, (n,).

    `step_s` is the interval between the values and `time_s` the time constant.
    """
    import scipy.signal  # slow import, not needed at start-up

    memory = math.exp(-step_s / time_s)
    fresh = random.standard_normal(n)
    fresh[1:] *= math.sqrt(1.0 - memory**2)
    return np.asarray(rms * scipy.signal.lfilter([1.0], [1.0, -memory], fresh))


def change_rows(
    random: np.random.Generator, n: int, step_s: float, interval_s: float
) -> FloatArray:
    """Draw the level index of each row, (n,); it rises by 1 every `interval_s` on average."""
    return np.cumsum(random.random(n) < step_s / interval_s).astype(np.float64)


def held(levels: FloatArray, which: FloatArray) -> FloatArray:
    """Return the level at each row (n,), selected from `levels` by the indices `which` (n,)."""
    return np.asarray(levels[which.astype(np.int64)])


def lagged(target: FloatArray, time_s: FloatArray, step_s: float, initial: float) -> FloatArray:
    """Return a first-order lag (n,), τ dy/dt = target − y, exact for targets constant in each step.

    `time_s` (n,) is the time constant τ; each of its changes costs computing time. `initial` is
    the value before the first row.
    """
    import scipy.signal  # slow import, not needed at start-up

    followed = np.empty_like(target)
    edges = np.flatnonzero(np.diff(time_s)) + 1
    value = initial
    for piece in np.split(np.arange(target.size), edges):
        memory = math.exp(-step_s / float(time_s[piece[0]]))
        followed[piece], _ = scipy.signal.lfilter(
            [1.0 - memory], [1.0, -memory], target[piece], zi=[memory * value]
        )
        value = float(followed[piece[-1]])
    return followed


STEPS_PER_DAY = int(DAY_S / STEP_S)
STEPS_PER_HOUR = STEPS_PER_DAY // 24

BASE, TWO_SHIFT, WEEKDAYS, RESERVE = range(4)
WET_SHARES = (0.72, 0.20, 0.06, 0.02)
DRY_SHARES = (0.40, 0.36, 0.18, 0.06)
"""Probabilities of the kinds of week in the wet and the dry season."""

LOAD_EDGES_H = (0, 6, 9, 12, 17, 22, 24)
LOAD_RANGES = (
    ((0.6, 1.0), (0.8, 1.0), (0.94, 1.0), (0.92, 1.0), (0.95, 1.0), (0.75, 1.0)),
    ((0.5, 0.7), (0.6, 0.95), (0.75, 1.0), (0.7, 1.0), (0.9, 1.0), (0.5, 0.8)),
    ((0.6, 0.9), (0.7, 0.95), (0.8, 1.0), (0.8, 1.0), (0.9, 1.0), (0.7, 0.95)),
    ((0.5, 0.7), (0.5, 0.8), (0.6, 0.9), (0.6, 0.9), (0.7, 1.0), (0.5, 0.7)),
)
"""Load ranges over the day as shares of rated power, by kind of week."""

OUTAGE_BEGINS_DAY = (130.0, 270.0)
OUTAGE_DAYS = (12.0, 26.0)
TRIPS_PER_YEAR = 5.0
TRIP_H = (2.0, 40.0)
LONG_NO_LOAD_SHARE = 0.03
"""Share of starts with 3 to 8 h at speed without load for tests, instead of 10 to 30 min."""

RUN_UP_SHARE = 0.3
"""Share of starts with a reading during the three minutes of the run-up."""


def draw_operation(
    random: np.random.Generator,
    time_ns: TimeArray,
    rated_speed_rpm: float,
    held: HeldLoad | None = None,
) -> Operation:
    """Draw the operation of a unit at times every 10 min; the first time is midnight.

    `held` is a period of constant load; None for random starts and stops.
    """
    first_day = int(time_ns[0] // DAY_NS)
    n_weeks = math.ceil(time_ns.size / STEPS_PER_DAY / 7)
    load = np.concatenate([_week(random, first_day + 7 * week) for week in range(n_weeks)])
    load = load[: time_ns.size]
    _stop_for_outages(random, load, first_day % YEAR_DAYS)
    _trip(random, load)
    speed = np.where(load > 0.0, 1.0, 0.0)
    _start(random, load, speed)
    if held is not None:  # after all random draws, so that their values do not change
        hour, later = time_ns % DAY_NS / (3600.0 * NS_PER_S), time_ns >= held.from_ns
        runs = np.any([(hour >= begin) & (hour < end) for begin, end in held.hours], axis=0)
        load[later], speed[later] = held.load * runs[later], runs[later]
    speed *= 1.0 + wander(random, load.size, STEP_S, 1800.0, 3e-4)
    power_mw = RATED_POWER_MW * np.maximum(load, 0.0)
    power_mw[load > 0.0] += 3.0 * random.standard_normal(int(np.sum(load > 0.0)))
    return Operation(time_ns, rated_speed_rpm * speed, power_mw, rated_speed_rpm)


def _week(random: np.random.Generator, day: int) -> FloatArray:
    """Draw the load of one week as a share of rated power; 0 is standstill."""
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
    """Add one long outage per year, in the dry season, in place."""
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
    """Begin each run at speed without load, and some runs with a reading during run-up."""
    for first in np.flatnonzero(np.diff((load > 0.0).astype(np.int8), prepend=np.int8(0)) == 1):
        is_long = random.random() < LONG_NO_LOAD_SHARE
        steps = random.integers(18, 49) if is_long else random.integers(1, 4)
        running = load[first : first + steps] > 0.0
        load[first : first + steps][running] = -1.0  # turning without load
        if random.random() < RUN_UP_SHARE:
            speed[first] = random.uniform(0.25, 0.9)
