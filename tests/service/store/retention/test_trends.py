"""Trends over what has become coarser say the same as before, and how fine they are."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from harness.places import Place
from rigs.assessments import assessment
from rigs.old_results import (
    HOUR_NS,
    NOW_NS,
    SECOND_NS,
    T0,
    TIERS,
    asked,
    delete_all,
    life,
    reading,
    require_same_hours,
)
from rigs.rolled_trends import gather_all, n_rows

from core.condition.operating_state import OperatingState
from service.store.retention.limits import RetentionLimits
from service.store.sqlite import SqliteStore
from service.store.value_range import ValueRange


@pytest.mark.parametrize(("limits", "widths"), TIERS)
def test_trends_of_a_state_say_the_same_before_and_after(
    rolled: SqliteStore,
    plain: SqliteStore,
    path: Path,
    limits: RetentionLimits,
    widths: tuple[int, ...],
) -> None:
    delete_all(rolled, limits)

    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    for minutes in widths:
        query = asked(minutes, states=(OperatingState.FULL_LOAD,))
        require_same_hours(rolled.trend(query), plain.trend(query))


@pytest.mark.parametrize(
    ("limits", "width_s"), [(TIERS[0][0], 60), (TIERS[1][0], 600), (TIERS[2][0], 3600)]
)
def test_a_trend_over_what_is_gone_says_how_fine_it_is(
    rolled: SqliteStore, limits: RetentionLimits, width_s: int
) -> None:
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


def test_pages_of_single_readings_say_from_when_on_there_are_any(rolled: SqliteStore) -> None:
    delete_all(rolled)

    page = rolled.trend(asked(is_page=True, max_points=1000))

    assert page.coarse_until_ns == NOW_NS - HOUR_NS
    assert min(page.time_ns) >= NOW_NS - HOUR_NS


def test_bounds_take_cells_that_are_wholly_within(rolled: SqliteStore, plain: SqliteStore) -> None:
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


def test_both_databases_say_the_same_before_and_after(store_place: Place) -> None:
    with closing(store_place.open()) as store:
        store.append(life(assessment, 150), [])
        gather_all(store)
        before = store.trend(asked(60))
        assert not store.retention.prune(RetentionLimits(letters_ns=HOUR_NS), NOW_NS)
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
