"""`GatheredEvidence`: what the mean deviation over each time scale says, reading by reading."""

import math
from dataclasses import dataclass

from core.baseline.baseline import QuantityBaseline, TimeScatter
from core.baseline.grouping import NOTHING_NEW, Newest, forgetting, forgetting_step


@dataclass(frozen=True)
class Counted:
    """A reading that counts: the numbers of `Deviations`."""

    deviation: float
    weight: float
    scatter: float
    offset_std: float


@dataclass(frozen=True)
class ScaleSums:
    """Forgetting sums over one time scale.

    Parameters
    ----------
    fill
        Of ones: how much of the time scale has been seen.
    weight, deviation, scatter, offset
        Of weights; weighted, of deviations, scatters of their cells, uncertainties that stay.
    """

    fill: float = 0.0
    weight: float = 0.0
    deviation: float = 0.0
    scatter: float = 0.0
    offset: float = 0.0

    def step(self, counted: Counted, middle: float, forgotten: float) -> "ScaleSums":
        """Take in one reading."""
        return ScaleSums(
            forgetting_step(self.fill, 1.0, forgotten),
            forgetting_step(self.weight, counted.weight, forgotten),
            forgetting_step(self.deviation, counted.weight * middle, forgotten),
            forgetting_step(self.scatter, counted.weight * counted.scatter, forgotten),
            forgetting_step(self.offset, counted.weight * counted.offset_std, forgotten),
        )


@dataclass(frozen=True)
class Finding:
    """A mean deviation.

    Parameters
    ----------
    change
        ln of what is measured over what was learned.
    std
        Standard uncertainty of a healthy film's mean deviation.
    """

    time_scale_h: float
    change: float
    std: float

    @property
    def significance(self) -> float:
        """Standard uncertainties away from no change."""
        return abs(self.change) / self.std


@dataclass(frozen=True)
class GatheredEvidence:
    """Deviations that have been counted so far.

    Parameters
    ----------
    n_counted
        How many.
    scales
        Sums over the time scales of the baseline.
    """

    n_counted: int = 0
    newest: Newest = NOTHING_NEW
    scales: tuple[ScaleSums, ...] = ()

    def step(self, counted: Counted, baseline: QuantityBaseline) -> "GatheredEvidence":
        """Count one more deviation.

        Raises
        ------
        ValueError
            If the evidence was gathered with another baseline's time scales.
        """
        times = baseline.time_scatter
        scales = self.scales or (ScaleSums(),) * len(times)
        if len(scales) != len(times):
            raise ValueError(f"evidence on {len(scales)} time scales, baseline on {len(times)}")
        newest = self.newest.step(counted.deviation)
        middle = newest.median
        return GatheredEvidence(
            self.n_counted + 1,
            newest,
            tuple(
                sums.step(counted, middle, _forgotten(time, baseline))
                for sums, time in zip(scales, times, strict=True)
            ),
        )

    def findings(self, baseline: QuantityBaseline) -> tuple[Finding, ...]:
        """What the time scales say that have been seen in full."""
        return tuple(
            _finding(sums, time)
            for sums, time in zip(self.scales, baseline.time_scatter, strict=True)
            if self.n_counted * baseline.reading_h >= time.time_scale_h
        )


def _forgotten(time: TimeScatter, baseline: QuantityBaseline) -> float:
    return forgetting(time.time_scale_h, baseline.reading_h)


def _finding(sums: ScaleSums, time: TimeScatter) -> Finding:
    offset = sums.offset / sums.weight
    # half-filled means stray further
    own = time.share * (sums.scatter / sums.weight) / sums.fill
    std = math.sqrt(own * own + offset * offset)
    return Finding(time.time_scale_h, sums.deviation / sums.weight, std)


NOTHING_GATHERED = GatheredEvidence()
