"""Buckets of readings over time: count, mean, extremes, worst quality."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.quality import Level
from core.units import DAY_NS
from service.store.port import Trend, TrendSeries

IntArray = npt.NDArray[np.int64]
LevelArray = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Summaries:
    """Summaries of readings, a row for each time and a column for each quantity.

    Parameters
    ----------
    names
        Of the columns.
    time_ns : (n,)
        When the readings were taken, or from when on.
    count, mean, minimum, maximum, level : (n, n_names)
        Usable readings, and the worst quality of all; where none was usable the numbers are NaN.
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
        """Every reading its own summary; values NaN where there is none."""
        count = np.isfinite(value).astype(np.int64)
        return cls(names, time_ns, count, value, value, value, level)

    @classmethod
    def together(cls, parts: list["Summaries"]) -> "Summaries":
        """All of some, at least one, in order of time."""
        time_ns = np.concatenate([part.time_ns for part in parts])
        order = np.argsort(time_ns, kind="stable")
        return cls(
            parts[0].names,
            time_ns[order],
            np.concatenate([part.count for part in parts])[order],
            np.concatenate([part.mean for part in parts])[order],
            np.concatenate([part.minimum for part in parts])[order],
            np.concatenate([part.maximum for part in parts])[order],
            np.concatenate([part.level for part in parts])[order],
        )

    def followed_by(self, other: "Summaries") -> "Summaries":
        """All rows of this one, then those of another with the same columns."""
        return Summaries(
            self.names,
            np.concatenate([self.time_ns, other.time_ns]),
            np.concatenate([self.count, other.count]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.minimum, other.minimum]),
            np.concatenate([self.maximum, other.maximum]),
            np.concatenate([self.level, other.level]),
        )

    def at(self, rows: IntArray | npt.NDArray[np.bool_]) -> "Summaries":
        """Some rows, in the order given."""
        return Summaries(
            self.names,
            self.time_ns[rows],
            self.count[rows],
            self.mean[rows],
            self.minimum[rows],
            self.maximum[rows],
            self.level[rows],
        )

    def only(self, names: tuple[str, ...]) -> "Summaries":
        """Some columns, in the order given."""
        columns = [self.names.index(name) for name in names]
        return Summaries(
            names,
            self.time_ns,
            self.count[:, columns],
            self.mean[:, columns],
            self.minimum[:, columns],
            self.maximum[:, columns],
            self.level[:, columns],
        )

    def in_spans(self, width_ns: int) -> "Summaries":
        """One summary for each aligned span of this width that has any, of rows in order."""
        if self.time_ns.size == 0:
            return self
        number = self.time_ns // width_ns
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        return self.summed(starts, number[starts] * width_ns)

    def summed(self, starts: IntArray, time_ns: IntArray) -> "Summaries":
        """One summary for each run of rows.

        Parameters
        ----------
        starts : (m,)
            First row of each run.
        time_ns : (m,)
            What is to stand for their times.
        """
        count = np.add.reduceat(self.count, starts, axis=0)
        weighed = np.where(self.count > 0, self.mean * np.maximum(self.count, 1), 0.0)
        total = np.add.reduceat(weighed, starts, axis=0)
        mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
        lowest = np.fmin.reduceat(self.minimum, starts, axis=0)
        highest = np.fmax.reduceat(self.maximum, starts, axis=0)
        mean = np.clip(mean, lowest, highest)  # rounding may carry a mean past equal values
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
