"""Learning of a baseline from the readings of a healthy bearing."""

import numpy as np

from core.arrays import BoolArray, FloatArray, IntArray, TimeArray
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline
from core.baseline.cell_table import CellTable
from core.baseline.grouping import Groups, group_readings
from core.baseline.history import QUANTITIES, StiffnessHistory
from core.baseline.scatter import time_scatter, with_scatter
from core.baseline.settings import BaselineSettings
from core.baseline.surface_fit import MIN_SCATTER, Fit, fit_surface, refit
from core.baseline.tabulate import tabulate
from core.condition.cells import FilmConditions
from core.units import DAY_NS

FOLDS = 5
LONGEST_SPELL_DAYS = 10


def held_out_deviations(
    time_ns: TimeArray,
    conditions: FilmConditions,
    value: FloatArray,
    groups: Groups,
    fit: Fit,
    table: CellTable,
    settings: BaselineSettings,
) -> FloatArray:
    """Return the cross-validated deviation of each `value`, ln k, from the surface, (n,).

    The surface is fitted without the fold of the reading, which consists of blocks of consecutive
    days. NaN in cells that have no support, or too few days in other folds.
    """
    n_days = np.unique(groups.day).size
    spell_days = int(np.clip(n_days // (2 * FOLDS), 1, LONGEST_SPELL_DAYS))
    group_fold = groups.day // spell_days % FOLDS
    fold = time_ns // DAY_NS // spell_days % FOLDS
    place = table.find(settings.grid.cells(conditions))
    deviation = np.full(value.size, np.nan)
    for left_out in range(FOLDS):
        rows = np.flatnonzero((fold == left_out) & (place >= 0))
        is_used = group_fold != left_out
        if rows.size == 0 or not is_used.any():
            continue
        rows = rows[_is_known_without(left_out, settings, groups, group_fold, table, place[rows])]
        surface = refit(groups, fit, settings.bend_std, is_used.astype(np.float64))
        deviation[rows] = value[rows] - surface.at(conditions.rows(rows))
    return deviation


def _is_known_without(
    left_out: int,
    settings: BaselineSettings,
    groups: Groups,
    group_fold: IntArray,
    table: CellTable,
    place: IntArray,
) -> BoolArray:
    """Return whether each cell has at least half of `min_days` without the fold `left_out`."""
    group_place = table.find(settings.grid.cells(groups.conditions))
    counted = (group_fold != left_out) & (group_place >= 0)
    days = np.unique(np.vstack([group_place[counted], groups.day[counted]]), axis=1)[0]
    n_days = np.bincount(days, minlength=len(table.cells))
    return np.asarray(2 * n_days[place] >= settings.min_days)


REJECTED = 0.1
"""Robust weight below which a group counts as rejected by the fit."""


def learn(
    history: StiffnessHistory,
    is_settled: BoolArray,
    origin: Origin,
    settings: BaselineSettings,
) -> BearingBaseline:
    """Learn the baseline of a bearing from readings that are mostly from a healthy machine.

    Only the readings selected by `is_settled` (n,) are used. A quantity whose readings cover fewer
    than `min_learning_days` gets no baseline.

    Raises ValueError if the history is empty.
    """
    if not len(history):
        raise ValueError("the history is empty; a baseline needs readings to learn from")
    found = [_learn_quantity(history, is_settled, each, settings) for each in QUANTITIES]
    return BearingBaseline(
        origin,
        int(history.time_ns[0]),
        int(history.time_ns[-1]),
        tuple(quantity for quantity in found if quantity is not None),
    )


def _learn_quantity(
    history: StiffnessHistory,
    is_settled: BoolArray,
    name: str,
    settings: BaselineSettings,
) -> QuantityBaseline | None:
    conditions, (value, u_random, _) = history.conditions, history.of(name)
    usable = is_settled & settings.is_known(conditions) & np.isfinite(value)
    time_ns, conditions, value = history.time_ns[usable], conditions.rows(usable), value[usable]
    if value.size == 0:
        return None
    groups = group_readings(time_ns, conditions, value, settings.grid)
    if np.unique(groups.day).size < settings.min_learning_days:
        return None
    fit = fit_surface(groups, settings)
    table = tabulate(conditions, value, groups, fit, settings)
    deviation = held_out_deviations(time_ns, conditions, value, groups, fit, table, settings)
    counted = np.isfinite(deviation)
    deviation, place = deviation[counted], table.find(settings.grid.cells(conditions))[counted]
    slope, day = fit.surface.slope(table.middle), time_ns[counted] // DAY_NS
    table = with_scatter(table, slope, place, day, deviation)
    scatter = table.scatter[place]
    return QuantityBaseline(
        quantity=name,
        grid=settings.grid,
        surface=fit.surface,
        attitude_covariance=fit.attitude_covariance,
        table=table,
        max_surface_std=settings.max_surface_std,
        scatter=float(np.median(scatter)) if scatter.size else MIN_SCATTER,
        u_random=float(np.median(u_random[usable])),
        reading_h=settings.reading_h,
        time_scatter=time_scatter(deviation, place, table, settings),
        rejected_share=float(np.mean(fit.robust_weight < REJECTED)),
    )
