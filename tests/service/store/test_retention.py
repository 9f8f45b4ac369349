"""What is old becomes coarser, and says the same as before; nothing goes that is not kept wider."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness.places import Place
from hypothesis import given, settings
from hypothesis import strategies as st

from core.assessment import Assessment
from core.condition.bearing_condition import BearingCondition
from core.condition.operating_state import OperatingState
from core.quality import GOOD, Reading, Reason, missing, uncertain
from service.store.port import Trend, TrendQuery
from service.store.retention import deleting
from service.store.retention.limits import RetentionLimits
from service.store.rollups import rolling
from service.store.sql_store import SqlStore
from service.store.sqlite import SqliteStore
from service.store.value_range import ValueRange

Build = Callable[..., Assessment]

HOUR_NS, MINUTE_NS, SECOND_NS = 3_600_000_000_000, 60_000_000_000, 1_000_000_000
T0 = 1_767_225_600_000_000_000
HOURS = 9
NOW_NS = T0 + HOURS * HOUR_NS
NAMES = ("speed_rpm", "stiffness_xx_n_per_m", "oil_temperature_c")
KEEP_NOTHING = RetentionLimits(readings_ns=0)


def life(build: Build, n: int = 600, seed: int = 1) -> list[Assessment]:
    """Nine hours with changing load, a lost probe and a hole."""
    random = np.random.default_rng(seed)
    times = np.sort(random.choice(HOURS * 3600, n, replace=False)) * SECOND_NS + T0
    hole = (times > T0 + 4.2 * HOUR_NS) & (times < T0 + 4.8 * HOUR_NS)
    return [reading(build, random, int(at)) for at in times[~hole]]


def reading(build: Build, random: np.random.Generator, at: int) -> Assessment:
    share = (at - T0) / (HOURS * HOUR_NS)
    state = OperatingState.PART_LOAD if share < 0.3 else OperatingState.FULL_LOAD
    doubt = GOOD if random.random() < 0.9 else uncertain(Reason.LOW_COVERAGE)
    readings = {
        "stiffness_xx_n_per_m": Reading(float(random.normal(1e9, 1e7)), doubt, u_random=2e6),
        "speed_rpm": Reading(float(random.normal(92.3, 1.0))),
        "eccentricity_ratio": Reading(round(float(random.normal(0.35, 0.02)), 3)),
        "oil_temperature_c": Reading(round(45.0 + 3.0 * share + float(random.normal(0, 0.3)), 1)),
    }
    if 0.6 < share < 0.7:
        readings["eccentricity_ratio"] = missing(Reason.SENSOR_FAILURE)
    return replace(build(at, **readings), condition=BearingCondition(state, True, None))


def gather_all(store: SqlStore) -> None:
    while due := store.rollups.due(1 << 62):
        for series in due:
            store.rollups.gather(series, 1 << 62)


def delete_all(store: SqlStore, limits: RetentionLimits = KEEP_NOTHING) -> None:
    for series in _series(store):
        while store.retention.delete(series, limits, NOW_NS):
            pass


def _series(store: SqlStore) -> list[int]:
    return list(store.retention.series())


def asked(minutes: int = 60, **changes: object) -> TrendQuery:
    """Buckets of so many minutes over everything."""
    n_points = HOURS * 60 // minutes + 1
    query = TrendQuery("U1", "UJB", NAMES, T0, T0 + HOURS * HOUR_NS, n_points, 1 << 62)
    return replace(query, **changes)  # type: ignore[arg-type]


def require_same(found: Trend, wanted: Trend) -> None:
    assert found.bucket_ns == wanted.bucket_ns
    assert list(found.time_ns) == list(wanted.time_ns)
    for name, theirs in wanted.series.items():
        ours = found.series[name]
        assert list(ours.minimum) == list(theirs.minimum), name
        assert list(ours.maximum) == list(theirs.maximum), name
        assert list(ours.count) == list(theirs.count), name
        assert list(ours.worst_level) == list(theirs.worst_level), name
        for our_mean, mean in zip(ours.mean, theirs.mean, strict=True):
            assert our_mean == (None if mean is None else pytest.approx(mean, rel=1e-9)), name


def n_rows(path: Path, table: str, where: str = "1") -> int:
    with closing(sqlite3.connect(path)) as connection:
        found = connection.execute(f"SELECT count(*) FROM {table} WHERE {where}")  # noqa: S608
        return int(found.fetchone()[0])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "old.sqlite3"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, assessment: Build) -> dict[str, bytes]:
    """Databases with a life in them, one of them gathered."""
    path = tmp_path_factory.mktemp("files") / "life.sqlite3"
    found = {}
    for name in ("plain", "gathered"):
        with closing(SqliteStore(path)) as store:
            if name == "plain":
                store.append(life(assessment), [])
            else:
                gather_all(store)
        found[name] = path.read_bytes()
    return found


@pytest.fixture
def old(path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with a life in it, gathered."""
    path.write_bytes(files["gathered"])
    with closing(SqliteStore(path)) as store:
        yield store


@pytest.fixture
def plain(tmp_path: Path, files: dict[str, bytes]) -> Iterator[SqliteStore]:
    """A store with the same life, of which nothing is ever gathered or deleted."""
    path = tmp_path / "plain.sqlite3"
    path.write_bytes(files["plain"])
    with closing(SqliteStore(path)) as store:
        yield store


TIERS = (
    (RetentionLimits(readings_ns=0), (2, 10, 60, 120)),
    (RetentionLimits(readings_ns=0, minutes_ns=0), (10, 30, 60, 120)),
    (RetentionLimits(readings_ns=0, minutes_ns=0, ten_minutes_ns=0), (60, 120)),
)


@pytest.mark.parametrize(("limits", "widths"), TIERS)
@pytest.mark.parametrize(
    "condition",
    [
        {},
        {"states": (OperatingState.FULL_LOAD,)},
    ],
)
def test_trends_say_the_same_before_and_after(
    old: SqliteStore,
    plain: SqliteStore,
    path: Path,
    limits: RetentionLimits,
    widths: tuple[int, ...],
    condition: dict[str, object],
) -> None:
    delete_all(old, limits)

    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    for minutes in widths:
        require_same(
            old.trend(asked(minutes, **condition)), plain.trend(asked(minutes, **condition))
        )


@pytest.mark.parametrize(
    ("limits", "width_s"), [(TIERS[0][0], 60), (TIERS[1][0], 600), (TIERS[2][0], 3600)]
)
def test_a_trend_over_what_is_gone_says_how_fine_it_is(
    old: SqliteStore, limits: RetentionLimits, width_s: int
) -> None:
    before = old.trend(asked(1, max_points=5000))
    assert (before.bucket_ns, before.coarse_until_ns) == (None, None)

    delete_all(old, limits)

    short = asked(start_ns=T0 + HOUR_NS, end_ns=T0 + 2 * HOUR_NS, max_points=5000)
    for query in (short, asked(max_points=5000)):
        found = old.trend(query)
        assert found.bucket_ns == width_s * SECOND_NS
        assert found.coarse_until_ns == NOW_NS - HOUR_NS
    newest = old.trend(asked(start_ns=NOW_NS - HOUR_NS, max_points=5000))
    assert (newest.bucket_ns, newest.coarse_until_ns) == (None, None)
    assert len(newest.time_ns) > 30


def test_pages_of_single_readings_say_from_when_on_there_are_any(old: SqliteStore) -> None:
    delete_all(old)

    page = old.trend(asked(is_page=True, max_points=1000))

    assert page.coarse_until_ns == NOW_NS - HOUR_NS
    assert min(page.time_ns) >= NOW_NS - HOUR_NS


def test_what_is_young_stays_as_it_was(old: SqliteStore, path: Path) -> None:
    keep = RetentionLimits(readings_ns=5 * HOUR_NS)

    delete_all(old, keep)

    assert n_rows(path, "assessment", f"time_ns < {T0 + 4 * HOUR_NS}") == 0
    young = asked(start_ns=T0 + 4 * HOUR_NS, max_points=5000)
    assert old.trend(young).bucket_ns is None


def test_without_limits_nothing_is_deleted(old: SqliteStore, path: Path) -> None:
    before = path.read_bytes()
    delete_all(old, RetentionLimits())
    assert path.read_bytes() == before


def test_what_is_not_rolled_up_is_not_deleted(plain: SqliteStore, tmp_path: Path) -> None:
    n_before = n_rows(tmp_path / "plain.sqlite3", "assessment")
    delete_all(plain)
    assert n_rows(tmp_path / "plain.sqlite3", "assessment") == n_before


@pytest.mark.parametrize("width_s", [60, 600, 3600])
@pytest.mark.parametrize(
    "damage",
    [
        "DELETE FROM rollup_numbers WHERE {where}",
        "DELETE FROM rollup_cell WHERE {where}",
        "UPDATE rollup_cell SET n_readings = n_readings + 1 WHERE {where}",
    ],
)
def test_what_is_rolled_up_wrongly_is_gathered_anew_before_it_is_deleted(
    old: SqliteStore, plain: SqliteStore, path: Path, width_s: int, damage: str
) -> None:
    hour_ns = T0 + 2 * HOUR_NS
    where = f"width_s = {width_s} AND start_ns >= {hour_ns} AND start_ns < {hour_ns + HOUR_NS}"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(damage.format(where=where))

    delete_all(old)
    assert n_rows(path, "assessment", f"time_ns < {hour_ns}") == 0
    assert n_rows(path, "assessment", f"time_ns < {hour_ns + HOUR_NS}") > 30
    gather_all(old)
    delete_all(old)

    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    for minutes in (2, 10, 60):
        require_same(old.trend(asked(minutes)), plain.trend(asked(minutes)))


@pytest.mark.parametrize(("limits", "widths"), TIERS)
def test_late_readings_are_added_to_what_is_left_of_their_hour(
    old: SqliteStore,
    plain: SqliteStore,
    path: Path,
    assessment: Build,
    limits: RetentionLimits,
    widths: tuple[int, ...],
) -> None:
    delete_all(old, limits)
    random = np.random.default_rng(2)
    late = [
        reading(assessment, random, T0 + hour * HOUR_NS + second * SECOND_NS + 7)
        for hour, second in ((1, 5), (1, 700), (1, 3599), (4, 1800), (4, 1801))
    ]
    for store in (old, plain):
        store.append(late, [])

    for _ in range(2):  # before they are merged, and after that
        for minutes in widths:
            require_same(old.trend(asked(minutes)), plain.trend(asked(minutes)))
        gather_all(old)
    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    assert n_rows(path, "rollup_redo") == 0


def test_bounds_take_cells_that_are_wholly_within(old: SqliteStore, plain: SqliteStore) -> None:
    delete_all(old)
    bounds = {"oil_temperature_c": ValueRange(45.7, 46.9)}

    ours, theirs = old.trend(asked(60, **bounds)), plain.trend(asked(60, **bounds))

    pairs = list(
        zip(ours.series["speed_rpm"].count, theirs.series["speed_rpm"].count, strict=False)
    )
    assert all(n <= wanted for n, wanted in pairs)
    assert sum(n for n, _ in pairs) > 0.5 * sum(wanted for _, wanted in pairs)
    oil = ours.series["oil_temperature_c"]
    assert all(low is None or low >= 45.7 for low in oil.minimum)
    assert all(high is None or high <= 46.9 for high in oil.maximum)


def test_deleting_twice_changes_nothing(old: SqliteStore, path: Path) -> None:
    limits = TIERS[1][0]
    delete_all(old, limits)
    once = [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")]

    assert not any(old.retention.delete(series, limits, NOW_NS) for series in _series(old))
    assert [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")] == once


def test_each_piece_of_work_is_small(
    old: SqliteStore, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deleting, "MAX_READINGS", 150)
    (series,) = _series(old)
    before = n_rows(path, "assessment")
    while old.retention.delete(series, KEEP_NOTHING, NOW_NS):
        after = n_rows(path, "assessment")
        assert 0 < before - after <= 200
        before = after
    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("late"), st.integers(0, HOURS * 3600 - 1)),
        st.tuples(st.just("gather"), st.just(0)),
        st.tuples(st.sampled_from(["single", "minutes", "ten"]), st.integers(0, HOURS)),
    ),
    min_size=3,
    max_size=14,
)


@settings(max_examples=8, deadline=None)
@given(STEPS, st.integers(0, 2**31))
def test_whatever_happens_in_whatever_order_hours_say_what_was_read(
    tmp_path_factory: pytest.TempPathFactory,
    assessment: Build,
    steps: list[tuple[str, int]],
    seed: int,
) -> None:
    folder, random = tmp_path_factory.mktemp("order"), np.random.default_rng(seed)
    kept, whole = SqliteStore(folder / "kept"), SqliteStore(folder / "whole")
    with closing(kept), closing(whole):
        for store in (kept, whole):
            store.append(life(assessment, 80, seed), [])
        taken: set[int] = set()
        for what, number in steps:
            if what == "late" and number not in taken:
                taken.add(number)
                late = reading(assessment, random, T0 + number * SECOND_NS + 11)
                for store in (kept, whole):
                    store.append([late], [])
            elif what == "gather":
                gather_all(kept)
            elif what != "late":
                _delete_until(kept, what, number)
            require_same(kept.trend(asked(60)), whole.trend(asked(60)))


def _delete_until(store: SqliteStore, what: str, hour: int) -> None:
    age_ns = (HOURS - hour) * HOUR_NS
    limits = RetentionLimits(
        readings_ns=age_ns,
        minutes_ns=None if what == "single" else age_ns,
        ten_minutes_ns=age_ns if what == "ten" else None,
    )
    delete_all(store, limits)


def overwritten(writer: Any, series: int, hour_ns: int, _: object) -> None:
    """What gathering anew does, done to an hour of which only late readings are left."""
    rolling._gather_hour(writer, series, (hour_ns, hour_ns + HOUR_NS))


@pytest.mark.parametrize(
    ("module", "name", "bug"),
    [
        pytest.param(
            *(rolling, "merge_late", overwritten),
            marks=pytest.mark.planted("late readings overwrite what was rolled up"),
        ),
        pytest.param(
            *(deleting, "_stands_in", lambda *_: True),
            marks=pytest.mark.planted("readings deleted before they were rolled up"),
        ),
    ],
)
def test_planted_bugs_are_found(
    old: SqliteStore,
    plain: SqliteStore,
    path: Path,
    assessment: Build,
    monkeypatch: pytest.MonkeyPatch,
    module: object,
    name: str,
    bug: object,
) -> None:
    """Late readings that overwrite their hour, and deleting unseen what was not rolled up."""
    monkeypatch.setattr(module, name, bug)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(
            "DELETE FROM rollup_cell WHERE width_s = 3600 AND start_ns = ?", (T0 + 2 * HOUR_NS,)
        )
    delete_all(old)
    gather_all(old)
    delete_all(old)
    late = reading(assessment, np.random.default_rng(2), T0 + HOUR_NS + 7)
    for store in (old, plain):
        store.append([late], [])
    gather_all(old)

    with pytest.raises(AssertionError):
        require_same(old.trend(asked(60)), plain.trend(asked(60)))


def test_messages_that_are_done_are_deleted_but_for_the_last_of_an_alarm(
    path: Path, old: SqliteStore
) -> None:
    rows = [("raised", 1, "delivered"), ("raised", 2, "delivered"), ("raised", 3, "waiting")]
    rows += [("other", 1, "refused")]
    with closing(sqlite3.connect(path)) as connection, connection:
        for alarm, number, state in rows:
            connection.execute(
                "INSERT INTO outbox (receiver, event_id, alarm, number, body, queued_ns, is_urgent,"
                " is_active, state, done_ns) VALUES ('shift', ?, ?, ?, '{}', 0, 0, 1, ?, ?)",
                (f"{alarm}{number}", alarm, number, state, None if state == "waiting" else T0),
            )
    limits = RetentionLimits(letters_ns=HOUR_NS)

    old.retention.prune(limits, T0 + HOUR_NS)
    assert n_rows(path, "outbox") == 4
    old.retention.prune(limits, T0 + HOUR_NS + 1)

    assert n_rows(path, "outbox", "alarm = 'raised' AND number = 1") == 0
    assert n_rows(path, "outbox") == 3
    with closing(sqlite3.connect(path)) as connection, pytest.raises(sqlite3.IntegrityError):
        connection.execute("DELETE FROM outbox WHERE state = 'waiting'")


def test_both_databases_say_the_same_before_and_after(
    store_place: Place, assessment: Build
) -> None:
    with closing(store_place.open()) as store:
        store.append(life(assessment, 150), [])
        gather_all(store)
        before = store.trend(asked(60))
        for limits, _ in TIERS:
            delete_all(store, limits)
            require_same(store.trend(asked(60)), before)
        late = reading(assessment, np.random.default_rng(2), T0 + HOUR_NS + 7)
        store.append([late], [])
        unmerged = store.trend(asked(60))
        gather_all(store)

        require_same(store.trend(asked(60)), unmerged)
        counts, more = before.series["speed_rpm"].count, unmerged.series["speed_rpm"].count
        assert sum(more) == sum(counts) + 1
        n_left = store_place.execute(
            "SELECT count(*) FROM assessment WHERE time_ns < ?", (late.time_ns + 1,)
        )
        assert n_left[0][0] == 0
