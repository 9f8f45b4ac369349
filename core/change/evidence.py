"""Evidence of a change: the mean deviation over each time scale, reading by reading."""

import math
from dataclasses import dataclass
from statistics import median

from core.baseline.baseline import QuantityBaseline, TimeScatter
from core.baseline.grouping import MEDIAN_READINGS, ewma_step, ewma_weight


@dataclass(frozen=True, slots=True)
class Comparison:
    """One reading compared with its baseline: a row of `Deviations`, and the reading's `u_random`.

    Parameters
    ----------
    offset_std
        Standard uncertainty that averaging does not take away.
    """

    deviation: float
    weight: float
    scatter: float
    offset_std: float
    u_random: float


@dataclass(frozen=True, slots=True)
class ScaleSums:
    """Exponentially weighted sums over one time scale, weighted by readings.

    `fill` is that of ones: the part of the time scale that has been seen.
    """

    fill: float = 0.0
    weight: float = 0.0
    deviation: float = 0.0
    scatter: float = 0.0
    offset: float = 0.0

    def step(self, compared: Comparison, middle: float, alpha: float) -> "ScaleSums":
        """Add one reading; `middle` is the running median of the deviations."""
        weight = compared.weight
        return ScaleSums(
            ewma_step(self.fill, 1.0, alpha),
            ewma_step(self.weight, weight, alpha),
            ewma_step(self.deviation, weight * middle, alpha),
            ewma_step(self.scatter, weight * compared.scatter, alpha),
            ewma_step(self.offset, weight * compared.offset_std, alpha),
        )

    def finding(self, time: TimeScatter) -> "Finding":
        """Mean deviation over the time scale with its uncertainty."""
        offset = self.offset / self.weight
        # means over a half-filled time scale scatter further
        own = time.share * (self.scatter / self.weight) / self.fill
        std = math.sqrt(own * own + offset * offset)
        return Finding(time.time_scale_h, self.deviation / self.weight, std)


@dataclass(frozen=True, slots=True)
class Finding:
    """Mean deviation, ln of measured over learned, and standard uncertainty of a healthy one."""

    time_scale_h: float
    change: float
    std: float

    @property
    def significance(self) -> float:
        """Distance from no change, in standard uncertainties."""
        return abs(self.change) / self.std


@dataclass(frozen=True, slots=True)
class GatheredEvidence:
    """Deviations counted so far, and their sums over the time scales of the baseline.

    The median of the newest deviations is averaged, so that single spikes do not count.
    """

    n_counted: int = 0
    newest: tuple[float, ...] = ()
    scales: tuple[ScaleSums, ...] = ()

    def step(self, compared: Comparison, baseline: QuantityBaseline) -> "GatheredEvidence":
        """Add one reading.

        Raises
        ------
        ValueError
            If the evidence was gathered with another baseline's time scales.
        """
        times = baseline.time_scatter
        scales = self.scales or (ScaleSums(),) * len(times)
        if len(scales) != len(times):
            raise ValueError(f"evidence on {len(scales)} time scales, baseline on {len(times)}")
        newest = (*self.newest, compared.deviation)[-MEDIAN_READINGS:]
        middle = median(newest)
        return GatheredEvidence(
            self.n_counted + 1,
            newest,
            tuple(
                sums.step(compared, middle, ewma_weight(time.time_scale_h, baseline.reading_h))
                for sums, time in zip(scales, times, strict=True)
            ),
        )

    def findings(self, baseline: QuantityBaseline) -> list[Finding]:
        """Mean deviations over the time scales that have been seen in full."""
        return [
            sums.finding(time)
            for sums, time in zip(self.scales, baseline.time_scatter, strict=True)
            if self.n_counted * baseline.reading_h >= time.time_scale_h
        ]


NO_EVIDENCE = GatheredEvidence()
