"""Statistics of readings in time buckets: count, mean, minimum, maximum and worst quality."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.quality import Level
from core.units import DAY_NS
from service.store.port import Trend, TrendSeries

IntArray = npt.NDArray[np.int64]
LevelArray = npt.NDArray[np.uint8]


STATISTICS = ("count", "mean", "minimum", "maximum", "level")
ROWS = ("time_ns", *STATISTICS)


@dataclass(frozen=True)
class Summaries:
    """Statistics of readings; one row per time and one column per quantity.

    Parameters
    ----------
    names
        Names of the quantities.
    time_ns : (n,)
        Times of single readings, or starts of aggregated time spans, in ns since 1970 UTC.
    count : (n, n_names)
        Number of usable readings.
    mean, minimum, maximum : (n, n_names)
        Statistics of the usable readings; NaN without usable readings.
    level : (n, n_names)
        Worst quality level of all readings.
    """

    names: tuple[str, ...]
    time_ns: IntArray
    count: IntArray
    mean: FloatArray
    minimum: FloatArray
    maximum: FloatArray
    level: LevelArray

    @classmethod
    def of(
        cls, names: tuple[str, ...], time_ns: IntArray, value: FloatArray, level: LevelArray
    ) -> "Summaries":
        """Return the summaries of single readings.

        `value` (NaN if unusable) and `level` have the shape (n, n_names).
        """
        count = np.isfinite(value).astype(np.int64)
        return cls(names, time_ns, count, value, value, value, level)

    @classmethod
    def joined(cls, parts: Sequence["Summaries"]) -> "Summaries":
        """Return the concatenated rows of one or more summaries with the same columns."""
        rows = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ROWS}
        return cls(parts[0].names, **rows)

    @classmethod
    def together(cls, parts: Sequence["Summaries"]) -> "Summaries":
        """Return the rows of one or more summaries with the same columns, sorted by time."""
        found = cls.joined(parts)
        return found.at(np.argsort(found.time_ns, kind="stable"))

    def at(self, rows: IntArray | npt.NDArray[np.bool_]) -> "Summaries":
        """Return the rows selected by a mask (n,), or by indices (m,) in the order of indices."""
        return Summaries(self.names, **{name: getattr(self, name)[rows] for name in ROWS})

    def only(self, names: tuple[str, ...]) -> "Summaries":
        """Return the columns with the given names, which must exist, in the order of the names."""
        columns = [self.names.index(name) for name in names]
        chosen = {name: getattr(self, name)[:, columns] for name in STATISTICS}
        return Summaries(names, self.time_ns, **chosen)

    def in_spans(self, width_ns: int) -> "Summaries":
        """Return the rows, which must be sorted by time, aggregated into spans of `width_ns`."""
        if self.time_ns.size == 0:
            return self
        number = self.time_ns // width_ns
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        return self.summed(starts, number[starts] * width_ns)

    def summed(self, starts: IntArray, time_ns: IntArray) -> "Summaries":
        """Return the aggregate of each run of consecutive rows; `starts` is not empty.

        Parameters
        ----------
        starts : (m,)
            Index of the first row of each run, ascending from 0; a run ends where the next begins.
        time_ns : (m,)
            Time of each aggregated row.
        """
        count = np.add.reduceat(self.count, starts, axis=0)
        weighed = np.where(self.count > 0, self.mean * np.maximum(self.count, 1), 0.0)
        total = np.add.reduceat(weighed, starts, axis=0)
        mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
        lowest = np.fmin.reduceat(self.minimum, starts, axis=0)
        highest = np.fmax.reduceat(self.maximum, starts, axis=0)
        mean = np.clip(mean, lowest, highest)  # rounding may move a mean beyond equal extremes
        level = np.maximum.reduceat(self.level, starts, axis=0)
        return Summaries(self.names, time_ns, count, mean, lowest, highest, level)


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
"""Quality level by number, None for -1; a lookup table, for speed."""

MAX_DAYS = (2**63 - 1) // DAY_NS
"""Maximum bucket width in days; a wider bucket would exceed 64-bit nanoseconds."""


def bucket_width_ns(start_ns: int, end_ns: int, max_points: int, finest_ns: int = 1) -> int:
    """Return the smallest bucket width, in ns, with at most ``max_points`` buckets in a range.

    The width is one of `NICE_WIDTHS_NS`, or whole days. It is a multiple of `finest_ns`, the width
    of the finest available roll-ups, which is a divisor of a day.
    """
    # a range that is not aligned with the buckets may overlap one more bucket
    needed = -(-(end_ns - start_ns) // max(max_points - 1, 1))
    for width in NICE_WIDTHS_NS:
        if width >= needed and width % finest_ns == 0:
            return width
    return min(-(-needed // DAY_NS), MAX_DAYS) * DAY_NS


def single_points(readings: Summaries, hole_ns: int) -> Trend:
    """Return the trend of single readings, which are sorted by time; empty without readings.

    A point without values is inserted between readings that are more than `hole_ns` apart.
    """
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
    """Return the trend of the first ``max_points`` readings, which are sorted by time.

    A point without values is inserted between readings that are more than `hole_ns` apart.
    `Trend.next_ns` is the time of the first omitted reading; None if no reading is omitted.
    """
    if readings.time_ns.size <= max_points:
        return single_points(readings, hole_ns)
    shown = single_points(readings.at(np.arange(max_points)), hole_ns)
    return replace(shown, next_ns=int(readings.time_ns[max_points]))


def bucketed(readings: Summaries, width_ns: int) -> Trend:
    """Return the trend of readings in buckets that start at multiples of `width_ns`.

    Buckets without readings between the first and the last reading are empty.
    """
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
