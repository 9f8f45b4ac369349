"""Mean deviations over all time scales of a whole history: what `GatheredEvidence` finds."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import Deviations, QuantityBaseline
from core.baseline.grouping import forgetting, forgetting_sum, running_median


@dataclass(frozen=True, eq=False)
class FindingHistory:
    """Findings after each counted reading.

    Parameters
    ----------
    change : (n_scales, n)
        Zero until a time scale has been seen in full.
    significance : (n_scales, n)
        -1 until then.
    time_scales_h : (n_scales,)
    """

    change: FloatArray
    significance: FloatArray
    time_scales_h: FloatArray

    @property
    def is_found(self) -> npt.NDArray[np.bool_]:
        """(n,) whether any time scale has been seen in full."""
        return np.asarray(np.any(self.significance >= 0.0, axis=0))

    def strongest(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Change, significance and time scale of the most significant: (n,) each, or NaN."""
        if not self.time_scales_h.size:
            nothing = np.full(self.change.shape[1], np.nan)
            return nothing, nothing, nothing
        row = np.argmax(self.significance, axis=0)
        column = np.arange(row.size)
        columns = (
            self.change[row, column],
            self.significance[row, column],
            self.time_scales_h[row],
        )
        is_found = self.is_found
        change, significance, time_h = (np.where(is_found, c, np.nan) for c in columns)
        return change, significance, time_h


def finding_history(
    found: Deviations, counted: npt.NDArray[np.int64], baseline: QuantityBaseline
) -> FindingHistory:
    """Average the deviations of the counted rows."""
    middle = running_median(found.deviation[counted])
    weight, scatter = found.weight[counted], found.scatter[counted]
    offset_std = found.offset_std[counted]
    times_h = np.array([time.time_scale_h for time in baseline.time_scatter])
    shape = (times_h.size, counted.size)
    change, significance = np.zeros(shape), np.full(shape, -1.0)
    seen_h = np.arange(1, counted.size + 1) * baseline.reading_h
    for row, time in enumerate(baseline.time_scatter):
        forgotten = forgetting(time.time_scale_h, baseline.reading_h)
        fill, total, deviation, stray, offset = (
            forgetting_sum(column, forgotten)
            for column in (
                *(np.ones(weight.size), weight, weight * middle),
                *(weight * scatter, weight * offset_std),
            )
        )
        own, stays = time.share * (stray / total) / fill, offset / total
        std = np.sqrt(own * own + stays * stays)
        is_full = seen_h >= time.time_scale_h
        change[row, is_full] = (deviation / total)[is_full]
        significance[row, is_full] = np.abs(change[row, is_full]) / std[is_full]
    return FindingHistory(change, significance, times_h)
