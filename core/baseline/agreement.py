"""Checks of learned baselines: difference of two baselines, drift during learning, outliers."""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import BoolArray, FloatArray, IntArray
from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import Support
from core.baseline.grouping import group_readings, robust_std
from core.baseline.history import QUANTITIES, StiffnessHistory


def mean_difference(first: BearingBaseline, second: BearingBaseline) -> dict[str, float]:
    """Return the mean difference of ln of the learned values, second minus first, by quantity.

    The mean is over cells with `Support.OWN` in both, weighted by the number of readings in the
    first. A quantity without such cells, or with different grids, is omitted.
    """
    found: dict[str, float] = {}
    for one in first.quantities:
        other = second.of(one.quantity)
        if other is None or other.grid != one.grid:
            continue
        known = {cell.cell for cell in other.table.cells if cell.support is Support.OWN}
        rows = [
            row
            for row, cell in enumerate(one.table.cells)
            if cell.support is Support.OWN and cell.cell in known
        ]
        if rows:
            conditions = one.table.middle.rows(np.array(rows))
            weight = np.array([one.table.cells[row].n_readings for row in rows], np.float64)
            difference = other.surface.at(conditions) - one.surface.at(conditions)
            found[one.quantity] = float(np.average(difference, weights=weight))
    return found


SPELL_DAYS = 8
"""Length in days of the time blocks for standard errors; longer than the correlation time of
healthy readings."""

MIN_SPELLS = 3

OUTLIER_STDS = 4.0
"""Number of standard deviations at which the residuals of the drift fit are clipped."""


@dataclass(frozen=True)
class Drift:
    """Change of ln of a quantity during its learning period, with its standard uncertainty."""

    change: float
    std: float


def learning_drift(
    history: StiffnessHistory, is_settled: BoolArray, baseline: QuantityBaseline
) -> Drift | None:
    """Return the drift of ln of a quantity about its baseline during the learning period.

    `is_settled` (n,) selects the readings. None if too few can be compared within a cell.
    """
    conditions, value = history.conditions, history.of(baseline.quantity)[0]
    usable = is_settled & baseline.is_known(conditions) & np.isfinite(value)
    if not usable.any():
        return None
    conditions, grid = conditions.rows(usable), baseline.grid
    residual = value[usable] - baseline.surface.at(conditions)
    groups = group_readings(history.time_ns[usable], conditions, residual, grid)
    _, cell = np.unique(grid.cells(groups.conditions), axis=1, return_inverse=True)
    return drift_within(groups.day, groups.value, cell.reshape(-1))


def drift_within(day: IntArray, value: FloatArray, cell: IntArray) -> Drift | None:
    """Return the drift of values (n,), n ≥ 1, whose `day` and condition cell are given, (n,).

    Values are compared within each cell. None if fewer than `MIN_SPELLS` time blocks contain values
    that can be compared.
    """
    since = (day - day.min()) / max(int(np.ptp(day)), 1)
    time, value = _within(since, cell), _within(value, cell)
    spell = (day - day.min()) // SPELL_DAYS
    if np.unique(spell[np.abs(time) > 0.0]).size < MIN_SPELLS:
        return None
    slope = _slope(time, value)
    left = value - slope * time
    limit = OUTLIER_STDS * max(robust_std(left), 1e-9)
    slope += _slope(time, np.clip(left, -limit, limit))
    left = np.clip(value - slope * time, -limit, limit)
    scores = np.bincount(spell, weights=time * left)
    return Drift(slope, float(np.sqrt(np.sum(scores**2)) / np.sum(time**2)))


def _within(x: FloatArray, cell: IntArray) -> FloatArray:
    """Return the differences (n,) of the values from the mean of their cell."""
    _, number = np.unique(cell, return_inverse=True)
    mean = np.bincount(number, weights=x) / np.bincount(number)
    return np.asarray(x - mean[number])


def _slope(time: FloatArray, value: FloatArray) -> float:
    return float(np.sum(time * value) / np.sum(time**2))


FAR_DEVIATION = math.log(2.0)
"""Implausible deviation of ln stiffness: a factor of two under the same condition. The published
stiffness of warm films at the same eccentricity and oil temperature differs by a few per cent
(Brito et al., Tables 8 and 9)."""


def far_readings(
    history: StiffnessHistory, is_settled: BoolArray, baseline: BearingBaseline
) -> str | None:
    """Return a warning text if settled readings are at least twice or at most half the baseline.

    None if no reading is that far from the baseline. `is_settled` (n,) selects the readings. The
    robust fit rejects far readings, so the baseline itself does not show them.
    """
    counts = []
    for learned in baseline.quantities:
        found = learned.compare_history(history)
        deviation = found.deviation[is_settled & (found.place >= 0)]
        if n := int(np.sum(np.abs(deviation) >= FAR_DEVIATION)):
            counts.append(
                f"{n} of {deviation.size} readings in {QUANTITIES[learned.quantity].label}"
            )
    if not counts:
        return None
    return f"{' and '.join(counts)} are at least twice or at most half the baseline; check units"
