"""Four hours of results of a machine that changes its load."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from core.assessment import Assessment
from core.condition.bearing_condition import BearingCondition
from core.condition.operating_state import OperatingState
from core.quality import GOOD, Reading, Reason, missing, uncertain
from service.store.port import TrendQuery

Build = Callable[..., Assessment]


T0 = 1_767_225_600_000_000_000 + 47 * 60_000_000_000
"""Thirteen minutes before a full hour."""

SECOND_NS, MINUTE_NS, HOUR_NS = 1_000_000_000, 60_000_000_000, 3_600_000_000_000
NAMES = ("stiffness_xx_n_per_m", "stiffness_xx_n_per_m.u_random", "speed_rpm", "vortex_roundness")
N = 700


def life(build: Build, seed: int = 1) -> list[Assessment]:
    """Four hours of a machine that changes its load, stands still and loses a probe; with holes."""
    random = np.random.default_rng(seed)
    time_ns = T0 + np.cumsum(random.integers(5, 35, N)) * SECOND_NS
    time_ns[N // 2 :] += 25 * MINUTE_NS
    return [result(build, random, int(at), i / N) for i, at in enumerate(time_ns)]


def result(build: Build, random: np.random.Generator, at: int, share: float) -> Assessment:
    """One result."""
    state = OperatingState.PART_LOAD if share < 0.3 else OperatingState.FULL_LOAD
    condition: BearingCondition | None = BearingCondition(state, True, None)
    doubt = GOOD if random.random() < 0.9 else uncertain(Reason.LOW_COVERAGE)
    readings = {
        "stiffness_xx_n_per_m": Reading(float(random.normal(1e9, 1e7)), doubt, u_random=2e6),
        "speed_rpm": Reading(float(random.normal(0.0, 92.3))),
        "eccentricity_ratio": Reading(round(float(random.normal(0.35, 0.02)), 3)),
        "oil_temperature_c": Reading(round(45.0 + 3.0 * share + float(random.normal(0, 0.3)), 1)),
    }
    if 0.6 < share < 0.7:
        readings["eccentricity_ratio"] = missing(Reason.SENSOR_FAILURE)
    if share > 0.95:
        condition, readings = None, {}
    return replace(build(at, **readings), condition=condition)


WHOLE = TrendQuery("U1", "UJB", NAMES, T0 - HOUR_NS, T0 + 8 * HOUR_NS, 40, MINUTE_NS)
"""All of it, in 40 buckets."""


def dump(path: Path) -> list[tuple[object, ...]]:
    """All that roll-ups hold."""
    with closing(sqlite3.connect(path)) as reader:
        cells = reader.execute("SELECT * FROM rollup_cell").fetchall()
        numbers = reader.execute(
            "SELECT quantities, width_s, start_ns, slot, numbers FROM rollup_numbers"
            " JOIN layout ON layout.id = layout ORDER BY 1, 2, 3, 4"
        ).fetchall()
        assert len(numbers) >= len(cells) > 0
        return cells + numbers
