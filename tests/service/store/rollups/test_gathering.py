"""However readings come they are gathered to the same, and trends say what single readings say."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from harness.places import SqlitePlace
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs.assessments import assessment
from rigs.rolled_trends import LATER_NS, gather_all, n_rows, require_same
from rigs.standing_clock import StandingClock
from rigs.tiers import first_fast
from rigs.varied_results import HOUR_NS, MINUTE_NS, NAMES, SECOND_NS, T0, WHOLE, N, dump

from core.condition.operating_state import OperatingState
from core.quality import Level, Reading
from service.store import trends
from service.store.loops import ROLLUP_PERIOD_S, RollupLoop
from service.store.port import QueryTooLargeError, StoreError, TrendQuery, ValueRange
from service.store.rollups import coverage as cover
from service.store.rollups import gathering as rolling
from service.store.rollups.rows import bins
from service.store.sqlite import SqliteStore

LONG = pytest.mark.long


@pytest.mark.long
def test_pieces_are_gathered_like_what_comes_at_once(plain, rolled, results, tmp_path):
    with closing(SqliteStore(tmp_path / "pieces.sqlite3")) as store:
        for first in range(0, N, 37):
            store.append(results[first : first + 37], [])
            gather_all(store)
        for found in (store, rolled):
            require_same(found.trend(WHOLE), plain.trend(WHOLE))

    assert dump(tmp_path / "rolled.sqlite3") == dump(tmp_path / "pieces.sqlite3")


def test_quantities_that_only_some_bearings_have_are_gathered_like_the_others(tmp_path):
    """Pads of one bearing, and a ratio with its uncertainty of another."""
    pads = ("pad_temperature_1_c", "head_m")
    ratio = "stiffness_xx_of_kb"
    with closing(SqliteStore(tmp_path / "recorded.sqlite3")) as store:
        for n in range(3 * 60):
            time_ns = T0 + n * MINUTE_NS
            value = Reading(0.5 + n, u_random=0.1, u_systematic=0.2)
            results = [
                assessment(time_ns, **dict.fromkeys(pads, 60.0 + n)),
                assessment(time_ns, bearing="LJB", **{ratio: value}),
            ]
            store.append(results, [])
        names = (*pads, "speed_rpm", ratio, f"{ratio}.u_random")
        asked = [replace(WHOLE, bearing=b, quantities=names, max_points=3) for b in ("UJB", "LJB")]
        single = [store.trend(each) for each in asked]
        gather_all(store)
        rolled = [store.trend(each) for each in asked]

    for found, wanted in zip(rolled, single, strict=True):
        require_same(found, wanted)
    assert rolled[0].series["head_m"].maximum[-1] == 239.0
    assert set(rolled[0].series[ratio].count) == {0}
    assert rolled[1].series[ratio].minimum[0] == 0.5
    assert set(rolled[1].series[f"{ratio}.u_random"].maximum) == {0.1}


@pytest.mark.parametrize("at_once", [2, 50])
@pytest.mark.usefixtures("rolled")
def test_a_bounded_number_of_readings_is_gathered_at_a_time(plain, tmp_path, monkeypatch, at_once):
    monkeypatch.setattr(rolling, "MAX_READINGS", at_once)
    gather_all(plain)

    assert dump(tmp_path / "plain.sqlite3") == dump(tmp_path / "rolled.sqlite3")


@pytest.mark.parametrize("late_min", [3, 200, *(pytest.param(n, marks=LONG) for n in (70, 254))])
def test_a_late_reading_is_in_every_trend_at_once_and_its_hour_is_gathered_anew(
    rolled, plain, tmp_path, late_min
):
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
    assert n_rows(tmp_path / "rolled.sqlite3", "rollup_redo") == 0


def test_a_crash_while_gathering_leaves_nothing_half_done(plain, tmp_path):
    place = SqlitePlace(tmp_path / "plain.sqlite3")
    place.execute(
        "CREATE TRIGGER crash BEFORE INSERT ON rollup_mark"
        " BEGIN SELECT RAISE(ABORT, 'power cut'); END"
    )
    before = plain.trend(WHOLE)

    (series,) = plain.rollups.due(LATER_NS)
    with pytest.raises(StoreError, match="power cut"):
        plain.rollups.gather(series, LATER_NS)

    require_same(plain.trend(WHOLE), before)
    assert n_rows(place.path, "rollup_cell") == 0
    place.unguard("crash", "rollup_mark")
    gather_all(plain)
    require_same(plain.trend(WHOLE), before)


def test_a_reading_from_the_future_does_not_make_all_others_late(plain, tmp_path):
    now_ns = T0 + 10 * HOUR_NS
    plain.append([assessment(T0 + 1000 * HOUR_NS, speed_rpm=1.0)], [])
    gather_all(plain, now_ns)

    assert n_rows(tmp_path / "plain.sqlite3", "rollup_mark", f"until_ns <= {now_ns}") == 1


@pytest.mark.parametrize("width", [0.05, 2.5, 0.1])
def test_a_value_on_the_bound_of_two_cells_is_in_the_upper_one(width):
    numbers = np.arange(-40, 400)
    bounds = np.array([round(int(number) * width, 9) for number in numbers])

    assert bins(bounds, width).tolist() == numbers.tolist()
    assert bins(np.nextafter(bounds, -np.inf), width).tolist() == (numbers - 1).tolist()


class Pile:
    """Roll-ups of bearings with some pieces of work each; the store may fail at times."""

    def __init__(self, *pieces: int) -> None:
        self.pieces = list(pieces)
        self.failures = 0

    def due(self, now_ns: int) -> Sequence[int]:
        del now_ns
        if self.failures:
            self.failures -= 1
            raise StoreError("disk full")
        return [series for series, left in enumerate(self.pieces) if left]

    def gather(self, series: int, now_ns: int) -> None:
        del now_ns
        self.pieces[series] -= 1


class Clock(StandingClock):
    """Time that passes when somebody waits, and ends when everything that was due is done."""

    def __init__(self, pile: Pile) -> None:
        super().__init__()
        self._pile = pile

    async def sleep(self, duration_s: float) -> None:
        self.s += duration_s
        if duration_s == ROLLUP_PERIOD_S and not any(self._pile.pieces):
            raise asyncio.CancelledError


async def rested_s(pile: Pile) -> float:
    """Gather everything; returns for how long the loop has rested."""
    clock = Clock(pile)
    with pytest.raises(asyncio.CancelledError):
        await RollupLoop(pile, clock).run()
    return clock.s


async def test_all_that_is_due_is_gathered_before_the_loop_rests():
    pile = Pile(3, 0, 5)

    assert await rested_s(pile) == ROLLUP_PERIOD_S
    assert pile.pieces == [0, 0, 0]


async def test_a_store_that_fails_is_asked_again_later():
    pile = Pile(2)
    pile.failures = 3

    assert await rested_s(pile) == 4 * ROLLUP_PERIOD_S
    assert pile.pieces == [0]


BOUNDS = st.one_of(st.none(), st.sampled_from([0.3, 0.35, 0.4]), st.floats(0.25, 0.45))
DEGREES = st.one_of(st.none(), st.sampled_from([45.0, 47.5]), st.floats(44.0, 49.0))
STATES = st.sampled_from(
    [(), (OperatingState.PART_LOAD,), (OperatingState.FULL_LOAD, OperatingState.STANDSTILL)]
)
STARTS = st.one_of(
    st.integers(-1, 5).map(lambda h: (T0 // HOUR_NS + h) * HOUR_NS),
    st.integers(-600, 18_000).map(lambda s: T0 + s * SECOND_NS + 123),
)


@pytest.mark.parametrize("n_examples", first_fast(1, [60, 400]))
def test_roll_ups_say_what_single_readings_say(plain, rolled, monkeypatch, n_examples):
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

    def counting(*arguments: object, **more: object) -> object:
        cells = select(*arguments, **more)  # type: ignore[arg-type]
        n_found[0] += 0 if cells is None else cells.summaries.time_ns.size
        return cells

    monkeypatch.setattr(cover, "select_cells", counting)
    return lambda: n_found[0]


def test_a_whole_range_of_gathered_hours_reads_no_single_reading(rolled, plain):
    day = replace(WHOLE, start_ns=T0 // HOUR_NS * HOUR_NS, end_ns=T0 // HOUR_NS * HOUR_NS + HOUR_NS)
    wanted = plain.trend(replace(day, max_points=2))
    rolled._writer.execute("DELETE FROM assessment WHERE time_ns < ?", (day.end_ns,))

    require_same(rolled.trend(replace(day, max_points=2)), wanted)


def test_a_quantity_that_was_not_known_when_it_was_gathered_is_null_there(rolled, plain):
    for store in (rolled, plain):
        store._writer.execute(
            "UPDATE layout SET quantities = replace(quantities, 'vortex_roundness', 'gone')"
        )

    require_same(rolled.trend(WHOLE), plain.trend(WHOLE))
    assert set(rolled.trend(WHOLE).series["vortex_roundness"].worst_level) <= {Level.BAD, None}


def test_few_readings_of_a_long_time_stay_single(rolled, plain):
    few = replace(WHOLE, states=(OperatingState.PART_LOAD,), max_points=N)

    assert rolled.trend(few).bucket_ns is None
    assert len(rolled.trend(few).time_ns) > 100
    require_same(rolled.trend(few), plain.trend(few))


def test_bounds_that_cut_too_many_cells_are_refused_before_all_are_read(rolled, monkeypatch):
    monkeypatch.setattr(cover, "MAX_CUT_SPANS", 5)
    whole_cells = replace(WHOLE, eccentricity_ratio=ValueRange(0.3, 0.4 - 1e-9))

    assert rolled.trend(whole_cells).time_ns
    with pytest.raises(QueryTooLargeError, match="at whole cells"):
        rolled.trend(replace(WHOLE, eccentricity_ratio=ValueRange(0.333, 0.367)))


@pytest.mark.parametrize("reach", [2**63 - 1, 10**21])
def test_a_range_wider_than_any_date_is_everything(rolled, plain, reach):
    giant = replace(WHOLE, start_ns=-reach, end_ns=reach, max_points=2)

    require_same(rolled.trend(giant), plain.trend(giant))
    assert sum(rolled.trend(giant).series["speed_rpm"].count) > 100
    later = replace(giant, start_ns=reach - 1)
    assert list(rolled.trend(later).time_ns) == []
