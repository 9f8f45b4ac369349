"""How far healthy means over time scales stray: what a change must stand out from.

Readings that follow one another are alike for hours and days, so that the mean of n strays by more
than the n-th part of their variance. How much more is not modelled but measured, on the very
statistic that decides later.
"""

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import TimeScatter
from core.baseline.robust import absolute_quantile_std
from core.baseline.settings import BaselineSettings
from core.baseline.smoothing import forgetting, forgetting_sum, running_median

LEAST_SPANS = 4.0
"""Time scales that the learning period must hold for one to be used."""

LEAST_SHARE = 1e-3


def time_scatter(
    deviation: FloatArray, scatter: FloatArray, settings: BaselineSettings
) -> tuple[TimeScatter, ...]:
    """Scatter on each time scale that the learning period is long enough for.

    Parameters
    ----------
    deviation, scatter : (n,)
        Readings from a surface that has not seen them, oldest first, and scatter of their cells.
    """
    smooth = running_median(deviation)
    # as `QuantityBaseline.compare` weighs typical readings
    typical = float(np.median(scatter)) if scatter.size else 1.0
    weight = np.minimum(1.0, (typical / scatter) ** 2)
    found: list[TimeScatter] = []
    for scale_h in settings.time_scales_h:
        spans = deviation.size * settings.reading_h / scale_h
        if spans < LEAST_SPANS:
            break
        forgotten = forgetting(scale_h, settings.reading_h)
        mean, stray = (forgetting_sum(weight * x, forgotten) for x in (smooth, scatter))
        share = absolute_quantile_std((mean / stray)[int(scale_h / settings.reading_h) :])
        # two time constants are one independent mean; few of them know their own scatter badly
        share *= 1.0 + 2.0 / spans
        if found:  # readings that are alike cannot average out faster than independent ones
            last = found[-1]
            share = max(share, last.share * (last.time_scale_h / scale_h) ** 0.5)
        found.append(TimeScatter(scale_h, max(share, LEAST_SHARE)))
    return tuple(found)
