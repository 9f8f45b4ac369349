"""Evidence of a change: mean deviations over each time scale, updated with each reading."""

import math
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from core.baseline.baseline import QuantityBaseline, TimeScatter
from core.baseline.grouping import MEDIAN_READINGS


class Comparison(NamedTuple):
    """Comparison of one reading with its baseline, one row of `Deviations`.

    Parameters
    ----------
    offset_std
        Part of the standard uncertainty that averaging does not reduce.
    u_random
        Random standard uncertainty of the reading, in ln.
    """

    deviation: float
    weight: float
    scatter: float
    offset_std: float
    u_random: float


class ScaleSums(NamedTuple):
    """Exponentially weighted sums (moving averages from 0) over one time scale.

    `fill` is the sum of ones, which approaches 1 as the time scale elapses; `weight` is the sum of
    the weights. The other fields are sums of weighted deviations and of their uncertainties.
    """

    fill: float = 0.0
    weight: float = 0.0
    deviation: float = 0.0
    scatter: float = 0.0
    offset: float = 0.0

    def step(self, compared: Comparison, middle: float, alpha: float) -> "ScaleSums":
        """Return the sums after one more reading, whose weight is `alpha`.

        `middle`, the running median deviation, is added instead of the reading's own deviation.
        """
        weight, kept = compared.weight, 1.0 - alpha
        return ScaleSums(
            self.fill * kept + alpha,
            self.weight * kept + alpha * weight,
            self.deviation * kept + alpha * (weight * middle),
            self.scatter * kept + alpha * (weight * compared.scatter),
            self.offset * kept + alpha * (weight * compared.offset_std),
        )

    def finding(self, time: TimeScatter) -> "Finding":
        """Return the mean deviation over the time scale of `time`, after at least one reading.

        `time.share` is the scatter of means relative to that of single readings; before the time
        scale has fully elapsed, means have a larger scatter.
        """
        offset = self.offset / self.weight
        own = time.share * (self.scatter / self.weight) / self.fill
        std = math.sqrt(own * own + offset * offset)
        return Finding(time.time_scale_h, self.deviation / self.weight, std)


class Finding(NamedTuple):
    """Mean deviation of ln k from the baseline over a time scale, with its standard uncertainty.

    `std` is the standard uncertainty expected for an unchanged film.
    """

    time_scale_h: float
    change: float
    std: float

    @property
    def significance(self) -> float:
        """Absolute change divided by its standard uncertainty."""
        return abs(self.change) / self.std


@dataclass(frozen=True, slots=True)
class GatheredEvidence:
    """Evidence on a film: number of counted readings, and sums over each time scale.

    The median of the deviations in `newest` is averaged, so that single spikes have no effect.
    """

    n_counted: int = 0
    newest: tuple[float, ...] = ()
    scales: tuple[ScaleSums, ...] = ()

    def step(self, compared: Comparison, baseline: QuantityBaseline) -> "GatheredEvidence":
        """Return the evidence with one more reading.

        Raises ValueError if the baseline has a different number of time scales than the evidence.
        """
        times = baseline.time_scatter
        scales = self.scales or (ScaleSums(),) * len(times)
        if len(scales) != len(times):
            found = f"{len(scales)} time scales, but the baseline has {len(times)}"
            raise ValueError(f"evidence has {found}; it is of another baseline, so discard it")
        newest = (*self.newest, compared.deviation)[-MEDIAN_READINGS:]
        middle = median(newest)
        return GatheredEvidence(
            self.n_counted + 1,
            newest,
            tuple(
                sums.step(compared, middle, alpha)
                for sums, alpha in zip(scales, baseline.scale_weights, strict=True)
            ),
        )

    def findings(self, baseline: QuantityBaseline) -> list[Finding]:
        """Return the mean deviation over each time scale that has fully elapsed."""
        if not self.n_counted:
            return []
        return [
            sums.finding(time)
            for sums, time in zip(self.scales, baseline.time_scatter, strict=True)
            if self.n_counted * baseline.reading_h >= time.time_scale_h
        ]


NO_EVIDENCE = GatheredEvidence()
