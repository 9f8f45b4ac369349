"""Buckets keep what matters: count, extremes, mean, worst quality."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.quality import Level
from core.units import DAY_NS
from service.store.buckets import NICE_WIDTHS_NS, Summaries, bucket_width_ns, bucketed

T0 = 1_767_225_600_000_000_000
SECOND_NS = 1_000_000_000

VALUES = st.one_of(st.none(), st.floats(-1e100, 1e100), st.sampled_from([0.1, 0.7e9]))


def readings_of(points: list[tuple[int, float | None, Level]]) -> Summaries:
    points = sorted(points, key=lambda point: point[0])
    value = [[np.nan if v is None else v] for _, v, _ in points]
    level = [[level] for _, _, level in points]
    return Summaries.of(
        ("q",),
        np.array([T0 + t * SECOND_NS // 10 for t, _, _ in points], dtype=np.int64),
        np.array(value, dtype=np.float64).reshape(-1, 1),
        np.array(level, dtype=np.uint8).reshape(-1, 1),
    )


@given(
    st.lists(
        st.tuples(st.integers(0, 5000), VALUES, st.sampled_from(Level)),
        min_size=1,
        max_size=60,
    ),
    st.sampled_from(NICE_WIDTHS_NS[:8]),
)
@settings(max_examples=100, deadline=None)
def test_buckets_lose_no_reading_no_extreme_and_no_doubt(
    points: list[tuple[int, float | None, Level]], width_ns: int
) -> None:
    readings = readings_of(points)

    trend = bucketed(readings, width_ns)
    series = trend.series["q"]

    values = [v for _, v, _ in points if v is not None]
    assert sum(series.count) == len(values)
    assert all(time_ns % width_ns == 0 for time_ns in trend.time_ns)
    assert set(np.diff(trend.time_ns)) <= {width_ns}
    for i, start_ns in enumerate(trend.time_ns):
        inside = (readings.time_ns >= start_ns) & (readings.time_ns < start_ns + width_ns)
        numbers = readings.mean[inside, 0]
        usable = numbers[np.isfinite(numbers)]
        assert series.count[i] == usable.size
        if usable.size:
            low, mean, high = series.minimum[i], series.mean[i], series.maximum[i]
            assert (low, high) == (usable.min(), usable.max())
            assert mean is not None
            assert usable.min() <= mean <= usable.max()
            assert mean == pytest.approx(usable.mean(), rel=1e-9, abs=1e-9 * abs(usable).max())
        else:
            assert series.minimum[i] is series.mean[i] is series.maximum[i] is None
        levels = readings.level[inside, 0]
        assert series.worst_level[i] == (Level(levels.max()) if levels.size else None)


@given(
    st.integers(0, 2**62),
    st.integers(1, 2**62 - 1),
    st.integers(2, 5000),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
@example(999_999_999, 10_000_000_000, 10, 0.0, 1.0)
@settings(max_examples=150, deadline=None)
def test_a_range_never_takes_more_buckets_than_asked_for(
    start_ns: int, length_ns: int, max_points: int, first: float, last: float
) -> None:
    width_ns = bucket_width_ns(start_ns, start_ns + length_ns, max_points)
    inside = sorted(start_ns + min(int(f * length_ns), length_ns - 1) for f in (first, last))

    assert width_ns in NICE_WIDTHS_NS or width_ns % DAY_NS == 0
    assert inside[1] // width_ns - inside[0] // width_ns + 1 <= max_points


def test_no_reading_at_all_makes_no_bucket() -> None:
    trend = bucketed(readings_of([]), SECOND_NS)

    assert list(trend.time_ns) == []
    assert list(trend.series["q"].mean) == []
