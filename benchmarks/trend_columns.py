"""A trend of 1,000 points × 12 quantities as JSON: by column, as the API gives it, and by point.

Both begin with what the store hands out and end with the bytes of the answer; the numbers in them
are the same.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable

from core.monitor.catalogue import CATALOGUE
from core.quality import Level
from service.api.answers import json_of
from service.api.routes.trends import trend_model
from service.api.values import LEVEL_NAMES, ApiModel, LevelName
from service.store.port import Trend, TrendQuery, TrendSeries

N_POINTS, N_QUANTITIES = 1000, 12
LEAST_RATIO = 5.0
NS_PER_MINUTE = 60_000_000_000


class PointModel(ApiModel):
    """One bucket of one quantity."""

    time: float
    """Seconds since 1970."""

    min: float | None
    """Lowest reading."""

    max: float | None
    """Highest reading."""

    mean: float | None
    """Mean of the readings."""

    count: int
    """Number of readings."""

    worst_level: LevelName | None
    """Worst quality."""


class PointsModel(ApiModel):
    """A trend by point."""

    series: dict[str, list[PointModel]]
    """The quantities."""


def stored(number: int) -> TrendSeries:
    values = [1e9 + number + 1e3 * n / 7 for n in range(N_POINTS)]
    return TrendSeries(values, values, values, [5] * N_POINTS, [Level.GOOD] * N_POINTS)


def by_point(trend: Trend) -> bytes:
    series = {
        name: [
            PointModel(
                time=t / 1e9,
                min=low,
                max=high,
                mean=mean,
                count=count,
                worst_level=None if level is None else LEVEL_NAMES[level],
            )
            for t, low, high, mean, count, level in zip(
                trend.time_ns, s.minimum, s.maximum, s.mean, s.count, s.worst_level, strict=True
            )
        ]
        for name, s in trend.series.items()
    }
    return PointsModel(series=series).model_dump_json().encode()


def fastest_ms(do: Callable[[], bytes], n_times: int) -> float:
    spent_s = []
    for _ in range(n_times):
        begun_s = time.perf_counter()
        do()
        spent_s.append(time.perf_counter() - begun_s)
    return 1e3 * min(spent_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    n_times = parser.parse_args().times
    names = [q.name for q in CATALOGUE if not q.keeps_uncertainty][:N_QUANTITIES]
    series = {name: stored(number) for number, name in enumerate(names)}
    times_ns = [n * NS_PER_MINUTE for n in range(N_POINTS)]
    trend = Trend(NS_PER_MINUTE, times_ns, series)
    query = TrendQuery("U1", "UJB", tuple(names), 0, N_POINTS * NS_PER_MINUTE, N_POINTS, 1)

    def by_column() -> bytes:
        return json_of(trend_model(query, trend))

    columns, points = json.loads(by_column()), json.loads(by_point(trend))
    for name in names:
        if columns["series"][name]["mean"] != [p["mean"] for p in points["series"][name]]:
            sys.exit(f"{name}: not the same numbers")
    column_ms = fastest_ms(by_column, n_times)
    point_ms = fastest_ms(lambda: by_point(trend), n_times)
    print(f"{'trend of 1,000 points × 12':<30}{'ms':>8}{'kB':>8}")
    print(f"{'by column':<30}{column_ms:>8.2f}{len(by_column()) / 1e3:>8.0f}")
    print(f"{'by point':<30}{point_ms:>8.2f}{len(by_point(trend)) / 1e3:>8.0f}")
    print(f"by column is {point_ms / column_ms:.1f} times cheaper; wanted: {LEAST_RATIO:g}")


if __name__ == "__main__":
    main()
