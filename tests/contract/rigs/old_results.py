"""Nine hours of results, and how they become coarser."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import GOOD, Reading, Reason, missing, uncertain
from rigs.rolled_trends import require_same
from service.store.port import Trend, TrendQuery
from service.store.retention import Ages
from service.store.store import Store

Build = Callable[..., Assessment]


HOUR_NS, MINUTE_NS, SECOND_NS = 3_600_000_000_000, 60_000_000_000, 1_000_000_000
T0 = 1_767_225_600_000_000_000
HOURS = 9
NOW_NS = T0 + HOURS * HOUR_NS
NAMES = ("speed_rpm", "stiffness_xx_n_per_m", "oil_temperature_c")
KEEP_NOTHING = {"readings_days": 0}


TIERS = (
    ({"readings_days": 0}, (2, 10, 60, 120)),
    ({"readings_days": 0, "minutes_days": 0}, (10, 30, 60, 120)),
    ({"readings_days": 0, "minutes_days": 0, "ten_minutes_days": 0}, (60, 120)),
)
"""What is kept, and how wide buckets are out of it, in minutes."""


def life(build: Build, n: int = 600, seed: int = 1) -> list[Assessment]:
    """Nine hours with changing load, a lost probe and a hole."""
    random = np.random.default_rng(seed)
    times = np.sort(random.choice(HOURS * 3600, n, replace=False)) * SECOND_NS + T0
    hole = (times > T0 + 4.2 * HOUR_NS) & (times < T0 + 4.8 * HOUR_NS)
    return [reading(build, random, int(at)) for at in times[~hole]]


def reading(build: Build, random: np.random.Generator, at: int) -> Assessment:
    """One result of the nine hours."""
    return result_at(build, random, at, (at - T0) / (HOURS * HOUR_NS))


def result_at(
    build: Build,
    random: np.random.Generator,
    at: int,
    share: float,
    speed_rpm: tuple[float, float] = (92.3, 1.0),
) -> Assessment:
    """One result after a share of all time; mean and standard deviation of the speed are given."""
    state = OperatingState.PART_LOAD if share < 0.3 else OperatingState.FULL_LOAD
    doubt = GOOD if random.random() < 0.9 else uncertain(Reason.LOW_COVERAGE)
    readings = {
        "stiffness_xx_n_per_m": Reading(float(random.normal(1e9, 1e7)), doubt, u_random=2e6),
        "speed_rpm": Reading(float(random.normal(*speed_rpm))),
        "eccentricity_ratio": Reading(round(float(random.normal(0.35, 0.02)), 3)),
        "oil_temperature_c": Reading(round(45.0 + 3.0 * share + float(random.normal(0, 0.3)), 1)),
    }
    if 0.6 < share < 0.7:
        readings["eccentricity_ratio"] = missing(Reason.SENSOR_FAILURE)
    return replace(build(at, **readings), condition=BearingCondition(state, True, None))


def delete_all(store: Store, limits: Ages = KEEP_NOTHING) -> None:
    """Delete until nothing is due."""
    for series in series_of(store):
        while store.retention.delete(series, limits, NOW_NS):
            pass


def series_of(store: Store) -> list[int]:
    """Numbers of all series."""
    return list(store.retention.series())


def asked(minutes: int = 60, **changes: object) -> TrendQuery:
    """Buckets of so many minutes over everything."""
    n_points = HOURS * 60 // minutes + 1
    query = TrendQuery("U1", "UJB", NAMES, T0, T0 + HOURS * HOUR_NS, n_points, 1 << 62)
    return replace(query, **changes)  # type: ignore[arg-type]


def require_same_hours(found: Trend, wanted: Trend) -> None:
    """As sums of sums say it."""
    require_same(found, wanted, within=1e-9)
