"""Scatter of the deviations of a healthy bearing, in each cell and over each time scale."""

from dataclasses import replace

import numpy as np

from core.arrays import FloatArray, IntArray
from core.baseline.baseline import TimeScatter
from core.baseline.cell_table import CellTable
from core.baseline.grouping import (
    STD_PER_MAD,
    absolute_quantile_std,
    ewma,
    ewma_weight,
    group_medians,
    running_median,
)
from core.baseline.settings import BaselineSettings
from core.baseline.surface_fit import MIN_SCATTER, slope_scatter

PRIOR_DAYS = 20.0
"""Number of days of readings that the `SlopeScatter` model is worth as a prior; large, because
deviations last for days."""

MAX_LASTING = 0.95
"""Largest fraction of the scatter that is attributed to lasting deviations."""


def with_scatter(
    table: CellTable,
    slope: FloatArray,
    place: IntArray,
    day: IntArray,
    deviation: FloatArray,
) -> CellTable:
    """Return the table with estimated `scatter` and `lasting`; unchanged without deviations.

    Parameters
    ----------
    slope : (n_cells,)
        Slope of the surface with eccentricity, at the median condition of each cell.
    place : (n,)
        Index of each reading's cell in the table.
    day : (n,)
        Day of each reading, counted from 1970.
    deviation : (n,)
        Cross-validated deviation of each reading from the surface, in ln.
    """
    if place.size == 0:
        return table
    place, mean = _daily(place, day, deviation)
    model = slope_scatter(slope[place], mean)
    expected = model.variance(slope)
    own, n_days = _own(place, mean, slope.size)
    variance = (n_days * own**2 + PRIOR_DAYS * expected) / (n_days + PRIOR_DAYS)
    scatter = np.maximum(np.sqrt(variance), MIN_SCATTER)
    lasting = scatter * np.minimum(np.sqrt(model.lasting(slope) / expected), MAX_LASTING)
    return CellTable(
        tuple(
            replace(cell, scatter=one, lasting=part)
            for cell, one, part in zip(table.cells, scatter.tolist(), lasting.tolist(), strict=True)
        )
    )


def _own(place: IntArray, mean: FloatArray, n_cells: int) -> tuple[FloatArray, FloatArray]:
    """Return the scatter of the daily means, and the number of days, of each cell (n_cells,)."""
    own, n_days = np.zeros(n_cells), np.zeros(n_cells)
    seen, numbered = np.unique(place, return_inverse=True)
    own[seen] = STD_PER_MAD * group_medians(np.abs(mean), numbered)
    n_days[seen] = np.bincount(numbered)
    return own, n_days


def _daily(place: IntArray, day: IntArray, deviation: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the table row and the mean deviation of each day in each cell."""
    keys, group = np.unique(np.vstack([place, day]), axis=1, return_inverse=True)
    group = group.reshape(-1)
    return keys[0], np.asarray(np.bincount(group, deviation) / np.bincount(group))


MIN_SPANS = 4.0
"""Required length of the learning period as a multiple of the time scale."""

MIN_SHARE, MAX_SHARE = 1e-3, 4.0
HALVINGS = 24


def time_scatter(
    deviation: FloatArray,
    place: IntArray,
    table: CellTable,
    settings: BaselineSettings,
) -> tuple[TimeScatter, ...]:
    """Return the scatter of means over each time scale for which there are enough readings.

    The deviations (n,) are cross-validated, oldest first; `place` (n,) are the indices of their
    cells in the table.
    """
    smooth, weight = running_median(deviation), _weight(table.scatter[place])
    columns = (np.ones(weight.size), smooth, table.passing[place], table.lasting[place])
    found: list[TimeScatter] = []
    for scale_h in settings.time_scales_h:
        spans = deviation.size * settings.reading_h / scale_h
        if spans < MIN_SPANS:
            break
        first = int(scale_h / settings.reading_h)
        forgotten = ewma_weight(scale_h, settings.reading_h)
        total, mean, stray, stays = (ewma(weight * column, forgotten)[first:] for column in columns)
        share = _share(mean / total, stray / total, stays / total)
        # independent means are two time constants apart; the scatter of few means is uncertain
        share *= 1.0 + 2.0 / spans
        if found:  # correlated readings cannot average out faster than independent ones
            last = found[-1]
            share = max(share, last.share * (last.time_scale_h / scale_h) ** 0.5)
        found.append(TimeScatter(scale_h, share))
    return tuple(found)


def _weight(scatter: FloatArray) -> FloatArray:
    """Return the weights that `QuantityBaseline.compare` gives to readings with typical noise."""
    typical = float(np.median(scatter)) if scatter.size else 1.0
    return np.minimum(1.0, (typical / scatter) ** 2)


def _share(mean: FloatArray, stray: FloatArray, stays: FloatArray) -> float:
    """Return the factor of `stray` (passing scatter) that fits the scatter of the means."""
    least, most = MIN_SHARE, MAX_SHARE
    for _ in range(HALVINGS):
        middle = (least * most) ** 0.5
        is_too_small = absolute_quantile_std(mean / np.hypot(middle * stray, stays)) > 1.0
        least, most = (middle, most) if is_too_small else (least, middle)
    return most
