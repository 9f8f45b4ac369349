"""How far healthy means over time scales stray: what a change must stand out from.

Readings that follow one another are alike for hours and days, so that the mean of n strays by more
than the n-th part of their variance. How much more is not modelled but measured, on the very
statistic that decides later.
"""

import numpy as np

from core.baseline.baseline import TimeScatter
from core.baseline.held_out import HeldOut
from core.baseline.robust import absolute_quantile_std, robust_std
from core.baseline.settings import BaselineSettings
from core.baseline.smoothing import forgetting, forgetting_sum, running_median

LEAST_SPANS = 4.0
"""Time scales that the learning period must hold for one to be used."""

LEAST_STD = 1e-6


def time_scatter(held_out: HeldOut, settings: BaselineSettings) -> tuple[TimeScatter, ...]:
    """Scatter on each time scale that the learning period is long enough for."""
    n = held_out.deviation.size
    smooth = running_median(held_out.deviation)
    overall = max(robust_std(held_out.deviation), LEAST_STD)
    weight = np.minimum(1.0, overall**2 / np.maximum(held_out.cell_scatter, LEAST_STD) ** 2)
    found: list[TimeScatter] = []
    for scale_h in settings.time_scales_h:
        spans = n * settings.reading_h / scale_h
        if spans < LEAST_SPANS:
            break
        forgotten = forgetting(scale_h, settings.reading_h)
        total = forgetting_sum(weight * smooth, forgotten) / forgetting_sum(weight, forgotten)
        std = absolute_quantile_std(total[int(scale_h / settings.reading_h) :])
        # two time constants are one independent mean; few of them know their own scatter badly
        std *= 1.0 + 2.0 / spans
        if found:  # readings that are alike cannot average out faster than independent ones
            last = found[-1]
            std = max(std, last.std * (last.time_scale_h / scale_h) ** 0.5)
        found.append(TimeScatter(scale_h, max(std, LEAST_STD)))
    return tuple(found)
