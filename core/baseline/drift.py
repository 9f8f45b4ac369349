"""Whether stiffness under like conditions has drifted while it was learned.

Within each cell, readings of different days are compared with one another only: what differs from
cell to cell drops out, and what is left over time is drift (the within estimator of panel data:
Wooldridge, Econometric Analysis of Cross Section and Panel Data, 10.5). Days that follow one
another are alike, so that its uncertainty is taken from spells of days (the same, 10.5.4).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.groups import group_readings
from core.baseline.robust import robust_std
from core.baseline.stiffness_history import StiffnessHistory
from core.baseline.watched import watched_values

SPELL_DAYS = 8
"""Longer than what makes healthy days alike."""

LEAST_SPELLS = 3

FAR = 4.0
"""Standard deviations beyond which a day counts no further."""


@dataclass(frozen=True)
class Drift:
    """Change of ln over the whole time of learning, with its standard uncertainty."""

    change: float
    std: float


def learning_drift(
    history: StiffnessHistory, is_settled: npt.NDArray[np.bool_], baseline: QuantityBaseline
) -> Drift | None:
    """How much the readings that a baseline was learned from have drifted.

    Returns
    -------
    None if too few conditions were met again in other spells.
    """
    conditions = history.conditions
    value, _ = watched_values(history, baseline.quantity, baseline.direction)
    usable = is_settled & baseline.is_known(conditions) & np.isfinite(value)
    if not usable.any():
        return None
    conditions, grid = conditions.rows(usable), baseline.grid
    residual = value[usable] - baseline.surface.at(conditions)
    groups = group_readings(history.time_ns[usable], conditions, residual, grid)
    _, cell = np.unique(grid.cells(groups.conditions), axis=1, return_inverse=True)
    return drift_within(groups.day, groups.value, cell.reshape(-1))


def drift_within(
    day: npt.NDArray[np.int64], value: FloatArray, cell: npt.NDArray[np.int64]
) -> Drift | None:
    """Drift of values over days, each compared only with others of its cell; (n,) all three."""
    since = (day - day.min()) / max(int(np.ptp(day)), 1)
    time, value = _within(since, cell), _within(value, cell)
    spell = (day - day.min()) // SPELL_DAYS
    if np.unique(spell[np.abs(time) > 0.0]).size < LEAST_SPELLS:
        return None
    slope = _slope(time, value)
    left = value - slope * time
    limit = FAR * max(robust_std(left), 1e-9)
    slope += _slope(time, np.clip(left, -limit, limit))
    left = np.clip(value - slope * time, -limit, limit)
    scores = np.bincount(spell, weights=time * left)
    return Drift(slope, float(np.sqrt(np.sum(scores**2)) / np.sum(time**2)))


def _within(x: FloatArray, cell: npt.NDArray[np.int64]) -> FloatArray:
    """Differences from the mean of each cell."""
    _, number = np.unique(cell, return_inverse=True)
    mean = np.bincount(number, weights=x) / np.bincount(number)
    return np.asarray(x - mean[number])


def _slope(time: FloatArray, value: FloatArray) -> float:
    return float(np.sum(time * value) / np.sum(time**2))
