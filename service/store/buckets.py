"""From single readings to buckets that keep what matters: extremes, mean, count, worst quality."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.quality import Level
from core.units import DAY_NS
from service.store.port import Trend, TrendSeries
from service.store.summaries import IntArray, Summaries

NICE_WIDTHS_S = (
    1,
    2,
    5,
    10,
    15,
    30,
    60,
    120,
    300,
    600,
    1200,
    1800,
    3600,
    7200,
    14400,
    21600,
    43200,
)
NICE_WIDTHS_NS = tuple(width * 1_000_000_000 for width in NICE_WIDTHS_S)
LEVEL_OF: dict[int, Level | None] = {-1: None} | {int(level): level for level in Level}
"""What a number stands for; looked up, since thousands are made into words at a time."""

MAX_DAYS = (2**63 - 1) // DAY_NS
"""Wider than that does not fit the nanoseconds; two of them hold all time since 1970."""


def bucket_width_ns(start_ns: int, end_ns: int, max_points: int, finest_ns: int = 1) -> int:
    """Narrowest width, round to people, at which a range takes at most ``max_points`` buckets.

    Parameters
    ----------
    finest_ns
        What there is of the range is in buckets of this width; it divides a day.
    """
    # aligned buckets may cut one more piece off the range than its length holds
    needed = -(-(end_ns - start_ns) // max(max_points - 1, 1))
    for width in NICE_WIDTHS_NS:
        if width >= needed and width % finest_ns == 0:
            return width
    return min(-(-needed // DAY_NS), MAX_DAYS) * DAY_NS


def single_points(readings: Summaries, hole_ns: int) -> Trend:
    """Every reading alone; a point without a value marks each hole, so that no line spans it."""
    holes = np.flatnonzero(np.diff(readings.time_ns) > hole_ns) + 1
    time_ns = np.insert(readings.time_ns, holes, readings.time_ns[holes - 1] + hole_ns // 2)
    series = {}
    for column, name in enumerate(readings.names):
        listed = _listed(np.insert(readings.mean[:, column], holes, np.nan))
        level = np.insert(readings.level[:, column].astype(np.int64), holes, -1)
        count = np.insert(readings.count[:, column], holes, 0).tolist()
        series[name] = TrendSeries(listed, listed, listed, count, _levels(level))
    return Trend(None, time_ns.tolist(), series)


def page(readings: Summaries, max_points: int, hole_ns: int) -> Trend:
    """The first readings, each alone, and from when on the next page goes on."""
    if readings.time_ns.size <= max_points:
        return single_points(readings, hole_ns)
    shown = single_points(readings.at(np.arange(max_points)), hole_ns)
    return replace(shown, next_ns=int(readings.time_ns[max_points]))


def bucketed(readings: Summaries, width_ns: int) -> Trend:
    """Gather summaries into aligned buckets; those between without readings are empty."""
    if readings.time_ns.size == 0:
        nothing = {name: TrendSeries([], [], [], [], []) for name in readings.names}
        return Trend(width_ns, [], nothing)
    summed = readings.in_spans(width_ns)
    number = summed.time_ns // width_ns
    first = int(number[0])
    n_buckets = int(number[-1]) - first + 1
    filled = number - first
    series = {
        name: _bucket_series(summed, column, filled, n_buckets)
        for column, name in enumerate(summed.names)
    }
    time_ns = (np.arange(first, first + n_buckets) * width_ns).tolist()
    return Trend(width_ns, time_ns, series)


def _bucket_series(summed: Summaries, column: int, filled: IntArray, n_buckets: int) -> TrendSeries:
    def spread(per_bucket: npt.NDArray[np.float64]) -> list[float | None]:
        everywhere = np.full(n_buckets, np.nan)
        everywhere[filled] = per_bucket[:, column]
        return _listed(everywhere)

    counts = np.zeros(n_buckets, dtype=np.int64)
    counts[filled] = summed.count[:, column]
    levels = np.full(n_buckets, -1)
    levels[filled] = summed.level[:, column]
    return TrendSeries(
        minimum=spread(summed.minimum),
        maximum=spread(summed.maximum),
        mean=spread(summed.mean),
        count=counts.tolist(),
        worst_level=_levels(levels),
    )


def _listed(values: FloatArray) -> list[float | None]:
    listed = values.astype(object)
    listed[np.isnan(values)] = None
    found: list[float | None] = listed.tolist()
    return found


def _levels(levels: IntArray) -> list[Level | None]:
    return [LEVEL_OF[level] for level in levels.tolist()]
