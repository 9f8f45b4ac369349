"""Trends out of roll-ups are those out of single readings, whatever is asked or happens."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.assessment import Assessment
from core.condition.bearing_condition import BearingCondition
from core.condition.operating_state import OperatingState
from core.quality import GOOD, Level, Reading, Reason, missing, uncertain
from service.store import schema, trends
from service.store.port import QueryTooLargeError, StoreError, Trend, TrendQuery
from service.store.rollups import cover, rolling
from service.store.rollups.cells import bins
from service.store.rollups.schema import ROLLUP_TABLES
from service.store.sqlite import SqliteStore
from service.store.sqlite.migrating import migrate
from service.store.value_range import ValueRange

Build = Callable[..., Assessment]

T0 = 1_767_225_600_000_000_000 + 47 * 60_000_000_000
"""Thirteen minutes before a full hour."""

SECOND_NS, MINUTE_NS, HOUR_NS = 1_000_000_000, 60_000_000_000, 3_600_000_000_000
NAMES = ("stiffness_xx_n_per_m", "stiffness_xx_n_per_m.u_random", "speed_rpm", "vortex_roundness")
N = 700
LATER_NS = 1 << 62


def life(build: Build, seed: int = 1) -> list[Assessment]:
    """Four hours of a machine that changes its load, stands still and loses a probe; with holes."""
    random = np.random.default_rng(seed)
    time_ns = T0 + np.cumsum(random.integers(5, 35, N)) * SECOND_NS
    time_ns[N // 2 :] += 25 * MINUTE_NS
    return [result(build, random, int(at), i / N) for i, at in enumerate(time_ns)]


def result(build: Build, random: np.random.Generator, at: int, share: float) -> Assessment:
    state = OperatingState.PART_LOAD if share < 0.3 else OperatingState.FULL_LOAD
    condition: BearingCondition | None = BearingCondition(state, True, None)
    doubt = GOOD if random.random() < 0.9 else uncertain(Reason.LOW_COVERAGE)
    readings = {
        "stiffness_xx_n_per_m": Reading(float(random.normal(1e9, 1e7)), doubt, u_random=2e6),
        "speed_rpm": Reading(float(random.normal(0.0, 92.3))),
        "eccentricity_ratio": Reading(round(float(random.normal(0.35, 0.02)), 3)),
        "oil_temperature_c": Reading(round(45.0 + 3.0 * share + float(random.normal(0, 0.3)), 1)),
    }
    if 0.6 < share < 0.7:
        readings["eccentricity_ratio"] = missing(Reason.SENSOR_FAILURE)
    if share > 0.95:
        condition, readings = None, {}
    return replace(build(at, **readings), condition=condition)


def gather_all(store: SqliteStore, now_ns: int = LATER_NS) -> None:
    while due := store.rollups.due(now_ns):
        for series in due:
            store.rollups.gather(series, now_ns)


@pytest.fixture
def plain(tmp_path: Path, assessment: Build) -> Iterator[SqliteStore]:
    """A store with a life in it, of which nothing is gathered."""
    store = SqliteStore(tmp_path / "plain.sqlite3")
    store.append(life(assessment), [])
    yield store
    store.close()


@pytest.fixture
def rolled(tmp_path: Path, assessment: Build) -> Iterator[SqliteStore]:
    """A store with the same life in it, all gathered."""
    store = SqliteStore(tmp_path / "rolled.sqlite3")
    store.append(life(assessment), [])
    gather_all(store)
    yield store
    store.close()


def require_same(found: Trend, wanted: Trend) -> None:
    assert found.bucket_ns == wanted.bucket_ns
    assert list(found.time_ns) == list(wanted.time_ns)
    assert set(found.series) == set(wanted.series)
    for name, theirs in wanted.series.items():
        ours = found.series[name]
        assert list(ours.minimum) == list(theirs.minimum), name
        assert list(ours.maximum) == list(theirs.maximum), name
        assert list(ours.count) == list(theirs.count), name
        assert list(ours.worst_level) == list(theirs.worst_level), name
        for mean, low, high, ours_mean in zip(
            theirs.mean, theirs.minimum, theirs.maximum, ours.mean, strict=True
        ):
            if mean is None or low is None or high is None or ours_mean is None:
                assert mean is ours_mean is None, name
            else:
                assert abs(ours_mean - mean) <= 1e-12 * max(abs(low), abs(high)), name


BOUNDS = st.one_of(st.none(), st.sampled_from([0.3, 0.35, 0.4]), st.floats(0.25, 0.45))
DEGREES = st.one_of(st.none(), st.sampled_from([45.0, 47.5]), st.floats(44.0, 49.0))
STATES = st.sampled_from(
    [(), (OperatingState.PART_LOAD,), (OperatingState.FULL_LOAD, OperatingState.STANDSTILL)]
)
STARTS = st.one_of(
    st.integers(-1, 5).map(lambda h: (T0 // HOUR_NS + h) * HOUR_NS),
    st.integers(-600, 18_000).map(lambda s: T0 + s * SECOND_NS + 123),
)


def test_roll_ups_say_what_single_readings_say(
    plain: SqliteStore, rolled: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    n_used = count_roll_ups(monkeypatch)
    monkeypatch.setattr(cover, "MAX_SPANS", 7)  # as a long time is read, piece by piece
    monkeypatch.setattr(trends, "ROWS_AT_ONCE", 50)

    @given(STARTS, STARTS, st.integers(2, 90), BOUNDS, BOUNDS, DEGREES, DEGREES, STATES)
    @settings(max_examples=150, deadline=None)
    def check(
        start: int,
        end: int,
        max_points: int,
        e_low: float | None,
        e_high: float | None,
        oil_low: float | None,
        oil_high: float | None,
        states: tuple[OperatingState, ...],
    ) -> None:
        asked = TrendQuery(
            "U1",
            "UJB",
            NAMES,
            *sorted((start, end + 1)),
            max_points,
            MINUTE_NS,
            ValueRange(e_low, e_high),
            ValueRange(oil_low, oil_high),
            states,
        )
        require_same(rolled.trend(asked), plain.trend(asked))

    check()
    assert n_used() > 100


def count_roll_ups(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Counts what is read out of roll-ups: equal numbers prove nothing if they never are."""
    n_found = [0]
    select = cover.select_cells

    def counting(*arguments: object) -> object:
        cells = select(*arguments)  # type: ignore[arg-type]
        n_found[0] += 0 if cells is None else cells.summaries.time_ns.size
        return cells

    monkeypatch.setattr(cover, "select_cells", counting)
    return lambda: n_found[0]


WHOLE = TrendQuery("U1", "UJB", NAMES, T0 - HOUR_NS, T0 + 8 * HOUR_NS, 40, MINUTE_NS)


def test_a_whole_range_of_gathered_hours_reads_no_single_reading(
    rolled: SqliteStore, plain: SqliteStore, path_of: Callable[[str], Path]
) -> None:
    day = replace(WHOLE, start_ns=T0 // HOUR_NS * HOUR_NS, end_ns=T0 // HOUR_NS * HOUR_NS + HOUR_NS)
    wanted = plain.trend(replace(day, max_points=2))
    with closing(sqlite3.connect(path_of("rolled"))) as other, other:
        other.execute("DELETE FROM assessment WHERE time_ns < ?", (day.end_ns,))

    require_same(rolled.trend(replace(day, max_points=2)), wanted)


@pytest.fixture
def path_of(tmp_path: Path) -> Callable[[str], Path]:
    """Where a store's file is."""
    return lambda name: tmp_path / f"{name}.sqlite3"


def test_what_comes_piece_by_piece_is_gathered_like_what_comes_at_once(
    plain: SqliteStore, assessment: Build, path_of: Callable[[str], Path]
) -> None:
    for name, piece in (("at-once", N), ("pieces", 37)):
        store = SqliteStore(path_of(name))
        results = life(assessment)
        for first in range(0, N, piece):
            store.append(results[first : first + piece], [])
            gather_all(store)
        require_same(store.trend(WHOLE), plain.trend(WHOLE))
        store.close()

    assert dump(path_of("at-once")) == dump(path_of("pieces"))


def test_a_bounded_number_of_readings_is_gathered_at_a_time(
    assessment: Build,
    path_of: Callable[[str], Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dumps = []
    for at_once in (2, 50, 10_000):
        monkeypatch.setattr(rolling, "MAX_READINGS", at_once)
        store = SqliteStore(path_of(f"slow-{at_once}"))
        store.append(life(assessment), [])
        gather_all(store)
        store.close()
        dumps.append(dump(path_of(f"slow-{at_once}")))
    assert dumps[0] == dumps[1] == dumps[2]


def dump(path: Path) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as reader:
        cells = reader.execute("SELECT * FROM rollup_cell").fetchall()
        numbers = reader.execute(
            "SELECT quantities, width_s, start_ns, slot, numbers FROM rollup_numbers"
            " JOIN layout ON layout.id = layout ORDER BY 1, 2, 3, 4"
        ).fetchall()
        assert len(numbers) >= len(cells) > 0
        return cells + numbers


@pytest.mark.parametrize("late_min", [3, 70, 200, 254])
def test_a_late_reading_is_in_every_trend_at_once_and_its_hour_is_gathered_anew(
    rolled: SqliteStore,
    plain: SqliteStore,
    assessment: Build,
    path_of: Callable[[str], Path],
    late_min: int,
) -> None:
    late = assessment(T0 + late_min * MINUTE_NS + 1, speed_rpm=1e6, eccentricity_ratio=0.35)
    later = [replace(late, time_ns=late.time_ns + i) for i in range(1, 4)]  # of the same hour
    for store in (plain, rolled):
        store.append([late], [])
        store.append([late, *later], [])

    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))
    gather_all(rolled)
    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))

    newer = [assessment(T0 + (300 + i) * MINUTE_NS, speed_rpm=1.0) for i in range(20)]
    for store in (plain, rolled):
        store.append(newer, [])
    gather_all(rolled)
    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))
    assert max(v for v in rolled.trend(WHOLE).series["speed_rpm"].maximum if v is not None) == 1e6
    with closing(sqlite3.connect(path_of("rolled"))) as reader:
        assert reader.execute("SELECT count(*) FROM rollup_redo").fetchone() == (0,)


def test_a_crash_while_gathering_leaves_nothing_half_done(
    plain: SqliteStore, path_of: Callable[[str], Path]
) -> None:
    with closing(sqlite3.connect(path_of("plain"))) as other, other:
        other.execute(
            "CREATE TRIGGER crash BEFORE INSERT ON rollup_mark"
            " BEGIN SELECT RAISE(ABORT, 'power cut'); END"
        )
    before = plain.trend(WHOLE)

    (series,) = plain.rollups.due(LATER_NS)
    with pytest.raises(StoreError, match="power cut"):
        plain.rollups.gather(series, LATER_NS)

    require_same(plain.trend(WHOLE), before)
    with closing(sqlite3.connect(path_of("plain"))) as other, other:
        assert other.execute("SELECT count(*) FROM rollup_cell").fetchone() == (0,)
        other.execute("DROP TRIGGER crash")
    gather_all(plain)
    require_same(plain.trend(WHOLE), before)


def test_a_reading_from_the_future_does_not_make_all_others_late(
    plain: SqliteStore, assessment: Build, path_of: Callable[[str], Path]
) -> None:
    now_ns = T0 + 10 * HOUR_NS
    plain.append([assessment(T0 + 1000 * HOUR_NS, speed_rpm=1.0)], [])
    gather_all(plain, now_ns)

    with closing(sqlite3.connect(path_of("plain"))) as reader:
        assert reader.execute("SELECT until_ns FROM rollup_mark").fetchone()[0] <= now_ns


def test_a_quantity_that_was_not_known_when_it_was_gathered_is_null_there(
    rolled: SqliteStore, plain: SqliteStore
) -> None:
    for store in (rolled, plain):
        store._writer.execute(
            "UPDATE layout SET quantities = replace(quantities, 'vortex_roundness', 'gone')"
        )

    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))
    assert set(rolled.trend(WHOLE).series["vortex_roundness"].worst_level) <= {Level.BAD, None}


@pytest.mark.parametrize("width", [0.05, 2.5, 0.1])
def test_a_value_on_the_bound_of_two_cells_is_in_the_upper_one(width: float) -> None:
    numbers = np.arange(-40, 400)
    bounds = np.array([round(int(number) * width, 9) for number in numbers])

    assert bins(bounds, width).tolist() == numbers.tolist()
    assert bins(np.nextafter(bounds, -np.inf), width).tolist() == (numbers - 1).tolist()


def test_few_readings_of_a_long_time_stay_single(rolled: SqliteStore, plain: SqliteStore) -> None:
    few = replace(WHOLE, states=(OperatingState.PART_LOAD,), max_points=N)

    assert rolled.trend(few).bucket_ns is None
    assert len(rolled.trend(few).time_ns) > 100
    require_same(rolled.trend(few), plain.trend(few))


def test_bounds_that_cut_through_too_many_cells_are_refused_before_they_are_all_read(
    rolled: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cover, "MAX_CUT_SPANS", 5)
    whole_cells = replace(WHOLE, eccentricity_ratio=ValueRange(0.3, 0.4 - 1e-9))

    assert rolled.trend(whole_cells).time_ns
    with pytest.raises(QueryTooLargeError, match="at whole cells"):
        rolled.trend(replace(WHOLE, eccentricity_ratio=ValueRange(0.333, 0.367)))


@pytest.mark.parametrize("reach", [2**63, 2**63 - 1, 10**21])
def test_a_range_wider_than_any_date_is_everything(
    rolled: SqliteStore, plain: SqliteStore, reach: int
) -> None:
    giant = replace(WHOLE, start_ns=-reach, end_ns=reach, max_points=2)

    require_same(rolled.trend(giant), plain.trend(giant))
    assert sum(rolled.trend(giant).series["speed_rpm"].count) > 100
    later = replace(giant, start_ns=reach - 1)
    assert list(rolled.trend(later).time_ns) == []


def test_a_database_from_before_roll_ups_is_gathered_after_its_upgrade(
    plain: SqliteStore, path_of: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = schema.MIGRATIONS[: schema.MIGRATIONS.index(ROLLUP_TABLES)]
    with closing(sqlite3.connect(path_of("old"), isolation_level=None)) as old:
        with monkeypatch.context() as at_that_time:
            at_that_time.setattr(schema, "MIGRATIONS", before)
            migrate(old, "old")
        old.execute("ATTACH ? AS other", (str(path_of("plain")),))
        for table in ("layout", "series", "assessment"):
            old.execute(f"INSERT INTO {table} SELECT * FROM other.{table}")  # noqa: S608
    store = SqliteStore(path_of("old"))

    require_same(store.trend(WHOLE), plain.trend(WHOLE))
    gather_all(store)
    require_same(store.trend(WHOLE), plain.trend(WHOLE))

    store.close()
    assert len(dump(path_of("old"))) > 1000
