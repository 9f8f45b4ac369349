"""What was appended is read back, to the last bit, or in buckets that keep what matters."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rigs.assessments import assessment
from rigs.store_fixtures import at, gap, query

from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Level, Quality, Reading, Reason, missing, uncertain
from core.units import DAY_NS
from service.runtime.asker import ASKER, Asker
from service.store import store as sql_store
from service.store import trends
from service.store.buckets import NICE_WIDTHS_NS, Summaries, bucket_width_ns, bucketed
from service.store.port import QueryTooLargeError, RefusedRowError, StoreError, ValueRange
from service.store.series import Layout, columns_of
from service.store.sqlite import SqliteStore
from service.store.sqlite import connections as readers

NAMES = tuple(quantity.name for quantity in CATALOGUE)


@st.composite
def readings(draw: st.DrawFn) -> dict[str, Reading]:
    chosen: dict[str, Reading] = {}
    for name in NAMES:
        level, reason = draw(st.sampled_from(Level)), draw(st.sampled_from(Reason))
        value = None if level is Level.BAD else draw(st.floats(allow_nan=False))
        chosen[name] = Reading(value, Quality(level, reason))
    return chosen


@given(readings())
@settings(max_examples=25, deadline=None)
def test_a_row_decodes_to_the_readings_it_was_made_of(given_):
    layout = Layout.of(NAMES)

    values, qualities = layout.encode(given_)
    number, level = layout.decode([values], [qualities])

    for column, name in enumerate(NAMES):
        value = given_[name].value
        assert np.isnan(number[0, column]) if value is None else number[0, column] == value
        assert level[0, column] == given_[name].quality.level
        assert layout.reasons[qualities[column] & 0b111111] == given_[name].quality.reason


@pytest.mark.parametrize("spoilt", [{"time_ns": 2**63}, {"bearing": "\ud800"}])
def test_a_row_that_no_database_takes_differs_from_a_database_that_takes_nothing(store, spoilt):
    good = assessment(at(0), speed_rpm=1.0)

    with pytest.raises(RefusedRowError):
        store.append([good, replace(good, **spoilt)], [])  # type: ignore[arg-type]
    assert list(store.trend(query()).time_ns) == []
    store.append([good], [])
    assert list(store.trend(query()).time_ns) == [at(0)]


def test_what_was_appended_is_read_back_to_the_last_bit(store):
    values = [0.6914e9, 0.1 + 0.2, 5e-324, 1.7976931348623157e308, -0.0]
    store.append([assessment(at(i), speed_rpm=v) for i, v in enumerate(values)], [])

    trend = store.trend(query("speed_rpm"))
    series = trend.series["speed_rpm"]

    assert trend.bucket_ns is None
    assert list(trend.time_ns) == [at(i) for i in range(5)]
    assert series.mean == series.minimum == series.maximum
    assert [np.float64(v).tobytes() for v in series.mean if v is not None] == [
        np.float64(v).tobytes() for v in values
    ]
    assert list(series.count) == [1] * 5


def test_a_missing_value_stays_missing_and_a_doubtful_one_doubtful(store):
    doubtful = Reading(92.3, uncertain(Reason.SPEED_UNKNOWN))
    store.append(
        [
            assessment(at(0), speed_rpm=92.3),
            assessment(at(1), speed_rpm=doubtful),
            assessment(at(2), speed_rpm=missing(Reason.STANDSTILL)),
        ],
        [],
    )

    series = store.trend(query("speed_rpm")).series["speed_rpm"]

    assert list(series.mean) == [92.3, 92.3, None]
    assert list(series.count) == [1, 1, 0]
    assert list(series.worst_level) == [Level.GOOD, Level.UNCERTAIN, Level.BAD]


def test_the_same_assessment_twice_counts_once(store):
    store.append([assessment(at(0), speed_rpm=90.0), assessment(at(0), speed_rpm=91.0)], [gap()])
    store.append([assessment(at(0), speed_rpm=92.0), assessment(at(1), speed_rpm=93.0)], [gap()])

    assert list(store.trend(query("speed_rpm")).series["speed_rpm"].mean) == [90.0, 93.0]
    assert len(store.gaps("U1", 0, 2 * at(0))) == 1


def test_bearings_and_units_do_not_mix(store):
    for number, (unit, bearing) in enumerate([("U1", "UJB"), ("U1", "LJB"), ("U2", "UJB")]):
        store.append(
            [assessment(unit=unit, bearing=bearing, speed_rpm=float(number))], [gap(unit=unit)]
        )

    assert list(store.trend(query(unit="U1", bearing="LJB")).series["speed_rpm"].mean) == [1.0]
    assert list(store.trend(query(unit="U2")).series["speed_rpm"].mean) == [2.0]
    assert list(store.trend(query(unit="U3")).time_ns) == []


def test_a_range_of_time_holds_its_start_but_not_its_end(store):
    store.append(
        [assessment(at(i), speed_rpm=float(i)) for i in range(5)],
        [gap(at(i), first_index=i) for i in range(5)],
    )

    found = store.trend(query(start_ns=at(1), end_ns=at(3)))

    assert list(found.time_ns) == [at(1), at(2)]
    assert [g.stop_ns for g in store.gaps("U1", at(1), at(3))] == [at(1), at(2)]


def test_readings_are_filtered_by_eccentricity_and_oil_temperature(store):
    for i in range(10):
        store.append(
            [
                assessment(
                    at(i), speed_rpm=float(i), eccentricity_ratio=i / 10, oil_temperature_c=40.0 - i
                )
            ],
            [],
        )
    store.append([assessment(at(10), speed_rpm=10.0)], [])

    def speeds(**filters: ValueRange) -> list[float | None]:
        return list(store.trend(query(**filters)).series["speed_rpm"].mean)

    assert speeds(eccentricity_ratio=ValueRange(0.2, 0.4)) == [2.0, 3.0, 4.0]
    assert speeds(eccentricity_ratio=ValueRange(low=0.8)) == [8.0, 9.0]
    assert speeds(oil_temperature_c=ValueRange(high=32.0)) == [8.0, 9.0]
    assert speeds(
        eccentricity_ratio=ValueRange(0.2, 0.4), oil_temperature_c=ValueRange(37.0, 50.0)
    ) == [2.0, 3.0]
    assert len(speeds()) == 11


def test_a_hole_is_marked_so_that_no_line_spans_it(store):
    store.append([assessment(at(i), speed_rpm=float(i)) for i in (0, 1, 5, 6)], [])

    trend = store.trend(query("speed_rpm", hole_ns=at(2) - at(0)))
    series = trend.series["speed_rpm"]

    assert list(series.mean) == [0.0, 1.0, None, 5.0, 6.0]
    assert list(series.count) == [1, 1, 0, 1, 1]
    assert series.worst_level[2] is None
    assert trend.time_ns == sorted(trend.time_ns)
    assert at(1) < trend.time_ns[2] < at(5)


def test_a_quantity_that_an_older_padwatch_did_not_know_is_null_there(path, monkeypatch):
    older = tuple(q for q in reversed(CATALOGUE) if q.name != "vortex_coherence_xx")
    with monkeypatch.context() as at_that_time:
        at_that_time.setattr(sql_store, "FIXED_COLUMNS", columns_of(older))
        old = SqliteStore(path)  # type: ignore[arg-type]
        old.append([assessment(at(0), speed_rpm=92.3, vortex_coherence_xx=0.5)], [])
        old.close()
    new = SqliteStore(path)  # type: ignore[arg-type]
    new.append([assessment(at(1), speed_rpm=92.4, vortex_coherence_xx=0.75)], [])

    trend = new.trend(query("speed_rpm", "vortex_coherence_xx"))
    new.close()

    assert list(trend.series["speed_rpm"].mean) == [92.3, 92.4]
    assert list(trend.series["vortex_coherence_xx"].mean) == [None, 0.75]
    assert list(trend.series["vortex_coherence_xx"].worst_level) == [Level.BAD, Level.GOOD]


def test_a_query_that_could_take_all_memory_is_refused_with_its_size(store, monkeypatch):
    store.append([assessment(at(i), speed_rpm=92.3) for i in range(11)], [])
    monkeypatch.setattr(trends, "MAX_ROWS", 10)

    with pytest.raises(QueryTooLargeError, match="more than 10 single readings"):
        store.trend(query())
    assert len(store.trend(query(end_ns=at(10))).time_ns) == 10


@pytest.mark.parametrize("reach", [2**63 - 1, 10**21])
def test_a_range_wider_than_any_date_is_everything(store, reach):
    store.append([assessment(at(i), speed_rpm=float(i)) for i in range(4)], [gap()])

    single = store.trend(query(start_ns=-reach, end_ns=reach))
    gathered = store.trend(query(start_ns=-reach, end_ns=reach, max_points=2))

    assert len(single.time_ns) == 4
    assert sum(gathered.series["speed_rpm"].count) == 4
    assert len(store.gaps("U1", -reach, reach)) == 1


def test_a_closed_store_says_so(store):
    store.close()
    store.close()

    with pytest.raises(StoreError, match="closed"):
        store.append([assessment()], [])


def test_a_result_of_all_quantities_takes_no_page_of_its_own(path):
    SqliteStore(path).close()
    before = path.stat().st_size
    everything = {
        q.name: Reading(1.0, u_random=0.1, u_systematic=0.1) if q.has_uncertainty else 1.0
        for q in CATALOGUE
    }
    with closing(SqliteStore(path)) as store:
        store.append([assessment(at(i), **everything) for i in range(400)], [])

    assert (path.stat().st_size - before) / 400 < 2500


def test_what_a_clock_shows_for_the_second_time_is_no_repetition(store):
    def measured(epoch: int, speed_rpm: float) -> Assessment:
        made = assessment(at(0), speed_rpm=speed_rpm)
        return replace(made, window=replace(made.window, epoch=epoch))

    for _ in range(2):  # the second time as after a commit of which nobody could tell
        store.append([measured(1, 90.0)], [])
        store.append([measured(2, 91.0), measured(3, 92.0)], [])

    series = store.trend(query("speed_rpm")).series["speed_rpm"]
    assert list(series.mean) == [90.0, 91.0, 92.0]


def test_a_read_ends_when_its_asker_has_gone(store, monkeypatch):
    monkeypatch.setattr(readers, "LOOK_AFTER_STEPS", 1)
    asker = Asker()
    before = ASKER.set(asker)
    try:
        assert store.trend(query()).time_ns == []

        asker.leave()

        with pytest.raises(StoreError, match="interrupted"):
            store.trend(query())
    finally:
        ASKER.reset(before)
    assert store.trend(query()).time_ns == []


def test_more_gaps_than_anybody_reads_are_refused(store, monkeypatch):
    monkeypatch.setattr(sql_store, "MAX_GAPS", 2)
    store.append([], [gap(stop_ns, first_index=stop_ns) for stop_ns in (1, 2, 3)])

    assert len(store.gaps("U1", 0, 3)) == 2
    with pytest.raises(QueryTooLargeError, match="more than 2 gaps"):
        store.gaps("U1", 0, 4)


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
def test_buckets_lose_no_reading_no_extreme_and_no_doubt(points, width_ns):
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
def test_a_range_never_takes_more_buckets_than_asked(start_ns, length_ns, max_points, first, last):
    width_ns = bucket_width_ns(start_ns, start_ns + length_ns, max_points)
    inside = sorted(start_ns + min(int(f * length_ns), length_ns - 1) for f in (first, last))

    assert width_ns in NICE_WIDTHS_NS or width_ns % DAY_NS == 0
    assert inside[1] // width_ns - inside[0] // width_ns + 1 <= max_points


def test_no_reading_at_all_makes_no_bucket():
    trend = bucketed(readings_of([]), SECOND_NS)

    assert list(trend.time_ns) == []
    assert list(trend.series["q"].mean) == []
