"""How far healthy means over time scales stray: what a change must stand out from.

Readings that follow one another are alike for hours and days, so that the mean of n strays by more
than the n-th part of their variance. How much more is not modelled but measured, on the very
statistic that decides later. What lasts for weeks is known from the cells and not averaged at all:
it varies from cell to cell, and a shaft that stays in one for a month shows all of it.
"""

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import TimeScatter
from core.baseline.cell_table import CellTable
from core.baseline.robust import absolute_quantile_std
from core.baseline.settings import BaselineSettings
from core.baseline.smoothing import forgetting, forgetting_sum, running_median

LEAST_SPANS = 4.0
"""Time scales that the learning period must hold for one to be used."""

LEAST_SHARE, MOST_SHARE = 1e-3, 4.0
HALVINGS = 24


def time_scatter(
    deviation: FloatArray,
    place: npt.NDArray[np.int64],
    table: CellTable,
    settings: BaselineSettings,
) -> tuple[TimeScatter, ...]:
    """Scatter on each time scale that the learning period is long enough for.

    Parameters
    ----------
    deviation, place : (n,)
        Readings from a surface that has not seen them, oldest first, and their cells.
    """
    smooth, weight = running_median(deviation), _weight(table.scatter[place])
    columns = (np.ones(weight.size), smooth, table.passing[place], table.lasting[place])
    found: list[TimeScatter] = []
    for scale_h in settings.time_scales_h:
        spans = deviation.size * settings.reading_h / scale_h
        if spans < LEAST_SPANS:
            break
        forgotten, first = (
            forgetting(scale_h, settings.reading_h),
            int(scale_h / settings.reading_h),
        )
        total, mean, stray, stays = (
            forgetting_sum(weight * column, forgotten)[first:] for column in columns
        )
        share = _share(mean / total, stray / total, stays / total)
        # two time constants are one independent mean; few of them know their own scatter badly
        share *= 1.0 + 2.0 / spans
        if found:  # readings that are alike cannot average out faster than independent ones
            last = found[-1]
            share = max(share, last.share * (last.time_scale_h / scale_h) ** 0.5)
        found.append(TimeScatter(scale_h, share))
    return tuple(found)


def _weight(scatter: FloatArray) -> FloatArray:
    """As `QuantityBaseline.compare` weighs typical readings."""
    typical = float(np.median(scatter)) if scatter.size else 1.0
    return np.minimum(1.0, (typical / scatter) ** 2)


def _share(mean: FloatArray, stray: FloatArray, stays: FloatArray) -> float:
    """Share of `stray` with which, beside what stays, means stray as far as they do."""
    least, most = LEAST_SHARE, MOST_SHARE
    for _ in range(HALVINGS):
        middle = (least * most) ** 0.5
        is_too_small = absolute_quantile_std(mean / np.hypot(middle * stray, stays)) > 1.0
        least, most = (middle, most) if is_too_small else (least, middle)
    return most
