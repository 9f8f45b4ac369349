"""Deviations of learning readings from a surface that was fitted without them.

From their own surface, readings deviate less than later ones will: it has bent towards them, most
of all towards what lasts for days. So spells of days are left out in turn.
"""

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.cell_table import CellTable
from core.baseline.fit import Fit, refit
from core.baseline.groups import DAY_NS, Groups
from core.baseline.settings import BaselineSettings
from core.condition.film_conditions import FilmConditions

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
    """Compare each learning reading with a surface that has not seen its spell.

    Returns
    -------
    (n,) NaN where there is no support without the spell.
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
    group_fold: npt.NDArray[np.int64],
    table: CellTable,
    place: npt.NDArray[np.int64],
) -> npt.NDArray[np.bool_]:
    """Whether half the days that a cell needs are there without the spell."""
    group_place = table.find(settings.grid.cells(groups.conditions))
    counted = (group_fold != left_out) & (group_place >= 0)
    days = np.unique(np.vstack([group_place[counted], groups.day[counted]]), axis=1)[0]
    n_days = np.bincount(days, minlength=len(table.cells))
    return np.asarray(2 * n_days[place] >= settings.min_days)
