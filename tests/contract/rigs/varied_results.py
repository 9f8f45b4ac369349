"""Four hours of results of a machine that changes its load."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from core.monitor.assessment import Assessment
from rigs.old_results import HOUR_NS, MINUTE_NS, SECOND_NS, Build, result_at
from service.store.port import TrendQuery

T0 = 1_767_225_600_000_000_000 + 47 * 60_000_000_000
"""Thirteen minutes before a full hour."""

NAMES = ("stiffness_xx_n_per_m", "stiffness_xx_n_per_m.u_random", "speed_rpm", "vortex_roundness")
N = 700


def life(build: Build, seed: int = 1) -> list[Assessment]:
    """Four hours of a machine that changes its load, loses a probe and ends; with holes."""
    random = np.random.default_rng(seed)
    time_ns = T0 + np.cumsum(random.integers(5, 35, N)) * SECOND_NS
    time_ns[N // 2 :] += 25 * MINUTE_NS
    n_full = 95 * N // 100 + 1
    found = [
        result_at(build, random, int(at), n / N, speed_rpm=(0.0, 92.3))
        for n, at in enumerate(time_ns[:n_full])
    ]
    return found + [replace(build(int(at)), condition=None) for at in time_ns[n_full:]]


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
