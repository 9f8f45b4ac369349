"""From single readings to buckets that keep what matters: extremes, mean, count, worst quality."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.quality import Level
from service.store.port import Trend, TrendSeries

IntArray = npt.NDArray[np.int64]
LevelArray = npt.NDArray[np.uint8]

NICE_WIDTHS_S = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600)
NICE_WIDTHS_NS = tuple(width * 1_000_000_000 for width in NICE_WIDTHS_S)
DAY_NS = 86_400_000_000_000
MAX_DAYS = (2**63 - 1) // DAY_NS
"""Wider than that does not fit the nanoseconds; two of them hold all time since 1970."""


@dataclass(frozen=True)
class Readings:
    """Readings of one bearing in order of time.

    Parameters
    ----------
    time_ns : (n_rows,)
    value, level
        For each quantity (n_rows,); the value NaN where there is none.
    """

    time_ns: IntArray
    value: Mapping[str, FloatArray]
    level: Mapping[str, LevelArray]


def bucket_width_ns(start_ns: int, end_ns: int, max_points: int) -> int:
    """Narrowest width, round to people, at which a range takes at most ``max_points`` buckets."""
    # aligned buckets may cut one more piece off the range than its length holds
    needed = -(-(end_ns - start_ns) // max(max_points - 1, 1))
    for width in NICE_WIDTHS_NS:
        if width >= needed:
            return width
    return min(-(-needed // DAY_NS), MAX_DAYS) * DAY_NS


def single_points(readings: Readings, hole_ns: int) -> Trend:
    """Every reading alone; a point without a value marks each hole, so that no line spans it."""
    holes = np.flatnonzero(np.diff(readings.time_ns) > hole_ns) + 1
    time_ns = np.insert(readings.time_ns, holes, readings.time_ns[holes - 1] + hole_ns // 2)
    series = {}
    for name, value in readings.value.items():
        number = np.insert(value, holes, np.nan)
        listed = _listed(number)
        level = np.insert(readings.level[name].astype(np.int64), holes, -1)
        count = np.isfinite(number).astype(int).tolist()
        series[name] = TrendSeries(listed, listed, listed, count, _levels(level))
    return Trend(None, time_ns.tolist(), series)


def page(readings: Readings, max_points: int, hole_ns: int) -> Trend:
    """The first readings, each alone, and from when on the next page goes on."""
    if readings.time_ns.size <= max_points:
        return single_points(readings, hole_ns)
    shown = Readings(
        readings.time_ns[:max_points],
        {name: value[:max_points] for name, value in readings.value.items()},
        {name: level[:max_points] for name, level in readings.level.items()},
    )
    return replace(single_points(shown, hole_ns), next_ns=int(readings.time_ns[max_points]))


def bucketed(readings: Readings, width_ns: int) -> Trend:
    """Gather readings into aligned buckets; those between without readings are empty."""
    if readings.time_ns.size == 0:
        nothing = {name: TrendSeries([], [], [], [], []) for name in readings.value}
        return Trend(width_ns, [], nothing)
    number = readings.time_ns // width_ns
    first = int(number[0])
    n_buckets = int(number[-1]) - first + 1
    starts = np.flatnonzero(np.diff(number, prepend=first - 1))
    filled = number[starts] - first
    series = {
        name: _bucket_series(value, readings.level[name], starts, filled, n_buckets)
        for name, value in readings.value.items()
    }
    time_ns = (np.arange(first, first + n_buckets) * width_ns).tolist()
    return Trend(width_ns, time_ns, series)


def _bucket_series(
    value: FloatArray, level: LevelArray, starts: IntArray, filled: IntArray, n_buckets: int
) -> TrendSeries:
    usable = np.isfinite(value)
    count = np.add.reduceat(usable.astype(np.int64), starts)
    total = np.add.reduceat(np.where(usable, value, 0.0), starts)
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)

    lowest, highest = np.fmin.reduceat(value, starts), np.fmax.reduceat(value, starts)
    mean = np.clip(mean, lowest, highest)  # rounding may carry a mean past equal values

    def spread(per_bucket: npt.NDArray[np.float64]) -> list[float | None]:
        everywhere = np.full(n_buckets, np.nan)
        everywhere[filled] = per_bucket
        return _listed(everywhere)

    counts = np.zeros(n_buckets, dtype=np.int64)
    counts[filled] = count
    levels = np.full(n_buckets, -1)
    levels[filled] = np.maximum.reduceat(level, starts)
    return TrendSeries(
        minimum=spread(lowest),
        maximum=spread(highest),
        mean=spread(mean),
        count=counts.tolist(),
        worst_level=_levels(levels),
    )


def _listed(values: FloatArray) -> list[float | None]:
    return [None if np.isnan(value) else value for value in values.tolist()]


def _levels(levels: IntArray) -> list[Level | None]:
    return [None if level < 0 else Level(level) for level in levels.tolist()]
