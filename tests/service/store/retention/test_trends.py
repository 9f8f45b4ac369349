"""Trends over what has become coarser say the same, whatever comes late, in whatever order."""

from contextlib import ExitStack, closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs.assessments import assessment
from rigs.memory_folder import memory_folder
from rigs.old_results import (
    HOUR_NS,
    HOURS,
    NOW_NS,
    SECOND_NS,
    T0,
    TIERS,
    Build,
    asked,
    delete_all,
    life,
    reading,
    require_same_hours,
)
from rigs.rolled_trends import gather_all, n_rows
from rigs.tiers import first_fast

from core.condition.operating_state import OperatingState
from service.store.port import ValueRange
from service.store.sqlite import SqliteStore


@pytest.mark.parametrize(("limits", "widths"), TIERS)
def test_late_readings_are_added_to_what_is_left_of_their_hour(rolled, plain, path, limits, widths):
    delete_all(rolled, limits)
    random = np.random.default_rng(2)
    late = [
        reading(assessment, random, T0 + hour * HOUR_NS + second * SECOND_NS + 7)
        for hour, second in ((1, 5), (1, 700), (1, 3599), (4, 1800), (4, 1801))
    ]
    for store in (rolled, plain):
        store.append(late, [])

    for _ in range(2):  # before they are merged, and after that
        for minutes in widths:
            for states in ((), (OperatingState.FULL_LOAD,)):
                query = asked(minutes, states=states)
                require_same_hours(rolled.trend(query), plain.trend(query))
        gather_all(rolled)
    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    assert n_rows(path, "rollup_redo") == 0


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("late"), st.integers(0, HOURS * 3600 - 1)),
        st.tuples(st.just("gather"), st.just(0)),
        st.tuples(st.sampled_from(["single", "minutes", "ten"]), st.integers(0, HOURS)),
    ),
    min_size=3,
    max_size=14,
)


@pytest.mark.parametrize("n_examples", first_fast(1, [6, 60]))
def test_whatever_happens_in_whatever_order_hours_say_what_was_read(n_examples):
    @settings(max_examples=n_examples, deadline=None)
    @given(STEPS, st.integers(0, 2**31))
    def check(steps: list[tuple[str, int]], seed: int) -> None:
        with ExitStack() as stack:
            folder = stack.enter_context(memory_folder())
            kept = stack.enter_context(closing(SqliteStore(folder / "kept")))
            whole = stack.enter_context(closing(SqliteStore(folder / "whole")))
            require_same_through(steps, kept, whole, assessment, seed)

    check()


def require_same_through(
    steps: list[tuple[str, int]], kept: SqliteStore, whole: SqliteStore, build: Build, seed: int
) -> None:
    """Do these steps with one store; the other one keeps everything."""
    random, taken = np.random.default_rng(seed), set[int]()
    for store in (kept, whole):
        store.append(life(build, 80, seed), [])
    for what, number in steps:
        if what == "late" and number not in taken:
            taken.add(number)
            late = reading(build, random, T0 + number * SECOND_NS + 11)
            for store in (kept, whole):
                store.append([late], [])
        elif what == "gather":
            gather_all(kept)
        elif what != "late":
            _delete_until(kept, what, number)
        require_same_hours(kept.trend(asked(60)), whole.trend(asked(60)))


def _delete_until(store: SqliteStore, what: str, hour: int) -> None:
    age_ns = (HOURS - hour) * HOUR_NS
    limits = {
        "readings_days": age_ns,
        "minutes_days": None if what == "single" else age_ns,
        "ten_minutes_days": age_ns if what == "ten" else None,
    }
    delete_all(store, {name: age for name, age in limits.items() if age is not None})


@pytest.mark.parametrize(
    ("limits", "width_s"), [(TIERS[0][0], 60), (TIERS[1][0], 600), (TIERS[2][0], 3600)]
)
def test_a_trend_over_what_is_gone_says_how_fine_it_is(rolled, limits, width_s):
    before = rolled.trend(asked(1, max_points=5000))
    assert (before.bucket_ns, before.coarse_until_ns) == (None, None)

    delete_all(rolled, limits)

    short = asked(start_ns=T0 + HOUR_NS, end_ns=T0 + 2 * HOUR_NS, max_points=5000)
    for query in (short, asked(max_points=5000)):
        found = rolled.trend(query)
        assert found.bucket_ns == width_s * SECOND_NS
        assert found.coarse_until_ns == NOW_NS - HOUR_NS
    newest = rolled.trend(asked(start_ns=NOW_NS - HOUR_NS, max_points=5000))
    assert (newest.bucket_ns, newest.coarse_until_ns) == (None, None)
    assert len(newest.time_ns) > 30


def test_pages_of_single_readings_say_from_when_on_there_are_any(rolled):
    delete_all(rolled)

    page = rolled.trend(asked(is_page=True, max_points=1000))

    assert page.coarse_until_ns == NOW_NS - HOUR_NS
    assert min(page.time_ns) >= NOW_NS - HOUR_NS


def test_bounds_take_cells_that_are_wholly_within(rolled, plain):
    delete_all(rolled)
    bounds = {"oil_temperature_c": ValueRange(45.7, 46.9)}

    ours, theirs = rolled.trend(asked(60, **bounds)), plain.trend(asked(60, **bounds))

    pairs = list(
        zip(ours.series["speed_rpm"].count, theirs.series["speed_rpm"].count, strict=False)
    )
    assert all(n <= wanted for n, wanted in pairs)
    assert sum(n for n, _ in pairs) > 0.5 * sum(wanted for _, wanted in pairs)
    oil = ours.series["oil_temperature_c"]
    assert all(low is None or low >= 45.7 for low in oil.minimum)
    assert all(high is None or high <= 46.9 for high in oil.maximum)


def test_both_databases_say_the_same_before_and_after(store_place):
    with closing(store_place.open()) as store:
        store.append(life(assessment, 150), [])
        gather_all(store)
        before = store.trend(asked(60))
        assert not store.retention.prune({"messages_days": HOUR_NS}, NOW_NS)
        for limits, _ in TIERS:
            delete_all(store, limits)
            require_same_hours(store.trend(asked(60)), before)
        late = reading(assessment, np.random.default_rng(2), T0 + HOUR_NS + 7)
        store.append([late], [])
        unmerged = store.trend(asked(60))
        gather_all(store)

        require_same_hours(store.trend(asked(60)), unmerged)
        counts, more = before.series["speed_rpm"].count, unmerged.series["speed_rpm"].count
        assert sum(more) == sum(counts) + 1
        n_left = store_place.execute(
            "SELECT count(*) FROM assessment WHERE time_ns < ?", (late.time_ns + 1,)
        )
        assert n_left[0][0] == 0
