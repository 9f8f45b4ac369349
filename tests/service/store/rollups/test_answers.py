"""Trends out of roll-ups are those out of single readings, whatever is asked."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs.rolled_trends import require_same
from rigs.tiers import fast_and_long
from rigs.varied_results import HOUR_NS, MINUTE_NS, NAMES, SECOND_NS, T0, WHOLE, N

from core.condition.operating_state import OperatingState
from core.quality import Level
from service.store import trends
from service.store.port import QueryTooLargeError, TrendQuery, ValueRange
from service.store.rollups import coverage as cover
from service.store.sqlite import SqliteStore

BOUNDS = st.one_of(st.none(), st.sampled_from([0.3, 0.35, 0.4]), st.floats(0.25, 0.45))
DEGREES = st.one_of(st.none(), st.sampled_from([45.0, 47.5]), st.floats(44.0, 49.0))
STATES = st.sampled_from(
    [(), (OperatingState.PART_LOAD,), (OperatingState.FULL_LOAD, OperatingState.STANDSTILL)]
)
STARTS = st.one_of(
    st.integers(-1, 5).map(lambda h: (T0 // HOUR_NS + h) * HOUR_NS),
    st.integers(-600, 18_000).map(lambda s: T0 + s * SECOND_NS + 123),
)


@pytest.mark.parametrize("n_examples", fast_and_long(60, 400))
def test_roll_ups_say_what_single_readings_say(
    plain: SqliteStore, rolled: SqliteStore, monkeypatch: pytest.MonkeyPatch, n_examples: int
) -> None:
    n_used = count_roll_ups(monkeypatch)
    monkeypatch.setattr(cover, "MAX_SPANS", 7)  # as a long time is read, piece by piece
    monkeypatch.setattr(trends, "ROWS_AT_ONCE", 50)

    @given(STARTS, STARTS, st.integers(2, 90), BOUNDS, BOUNDS, DEGREES, DEGREES, STATES)
    @settings(max_examples=n_examples, deadline=None)
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
    assert n_used() > n_examples // 4


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


def test_a_whole_range_of_gathered_hours_reads_no_single_reading(
    rolled: SqliteStore, plain: SqliteStore
) -> None:
    day = replace(WHOLE, start_ns=T0 // HOUR_NS * HOUR_NS, end_ns=T0 // HOUR_NS * HOUR_NS + HOUR_NS)
    wanted = plain.trend(replace(day, max_points=2))
    rolled._writer.execute("DELETE FROM assessment WHERE time_ns < ?", (day.end_ns,))

    require_same(rolled.trend(replace(day, max_points=2)), wanted)


def test_a_quantity_that_was_not_known_when_it_was_gathered_is_null_there(
    rolled: SqliteStore, plain: SqliteStore
) -> None:
    for store in (rolled, plain):
        store._writer.execute(
            "UPDATE layout SET quantities = replace(quantities, 'vortex_roundness', 'gone')"
        )

    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))
    assert set(rolled.trend(WHOLE).series["vortex_roundness"].worst_level) <= {Level.BAD, None}


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


@pytest.mark.parametrize("reach", [2**63 - 1, 10**21])
def test_a_range_wider_than_any_date_is_everything(
    rolled: SqliteStore, plain: SqliteStore, reach: int
) -> None:
    giant = replace(WHOLE, start_ns=-reach, end_ns=reach, max_points=2)

    require_same(rolled.trend(giant), plain.trend(giant))
    assert sum(rolled.trend(giant).series["speed_rpm"].count) > 100
    later = replace(giant, start_ns=reach - 1)
    assert list(rolled.trend(later).time_ns) == []
