"""However readings come, late, in pieces or before a crash, they are gathered to the same."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness.places import SqlitePlace
from rigs.assessments import assessment
from rigs.rolled_trends import LATER_NS, gather_all, n_rows, require_same
from rigs.varied_results import HOUR_NS, MINUTE_NS, T0, WHOLE, N, dump

from core.monitor.assessment import Assessment
from service.store.port import StoreError
from service.store.rollups import gathering as rolling
from service.store.rollups.rows import bins
from service.store.sqlite import SqliteStore

LONG = pytest.mark.long


def test_what_comes_piece_by_piece_is_gathered_like_what_comes_at_once(
    plain: SqliteStore, rolled: SqliteStore, results: list[Assessment], tmp_path: Path
) -> None:
    with closing(SqliteStore(tmp_path / "pieces.sqlite3")) as store:
        for first in range(0, N, 37):
            store.append(results[first : first + 37], [])
            gather_all(store)
        for found in (store, rolled):
            require_same(found.trend(WHOLE), plain.trend(WHOLE))

    assert dump(tmp_path / "rolled.sqlite3") == dump(tmp_path / "pieces.sqlite3")


@pytest.mark.parametrize("at_once", [2, 50])
@pytest.mark.usefixtures("rolled")
def test_a_bounded_number_of_readings_is_gathered_at_a_time(
    plain: SqliteStore, tmp_path: Path, monkeypatch: Any, at_once: int
) -> None:
    monkeypatch.setattr(rolling, "MAX_READINGS", at_once)
    gather_all(plain)

    assert dump(tmp_path / "plain.sqlite3") == dump(tmp_path / "rolled.sqlite3")


@pytest.mark.parametrize("late_min", [3, 200, *(pytest.param(n, marks=LONG) for n in (70, 254))])
def test_a_late_reading_is_in_every_trend_at_once_and_its_hour_is_gathered_anew(
    rolled: SqliteStore, plain: SqliteStore, tmp_path: Path, late_min: int
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
    assert n_rows(tmp_path / "rolled.sqlite3", "rollup_redo") == 0


def test_a_crash_while_gathering_leaves_nothing_half_done(
    plain: SqliteStore, tmp_path: Path
) -> None:
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


def test_a_reading_from_the_future_does_not_make_all_others_late(
    plain: SqliteStore, tmp_path: Path
) -> None:
    now_ns = T0 + 10 * HOUR_NS
    plain.append([assessment(T0 + 1000 * HOUR_NS, speed_rpm=1.0)], [])
    gather_all(plain, now_ns)

    assert n_rows(tmp_path / "plain.sqlite3", "rollup_mark", f"until_ns <= {now_ns}") == 1


@pytest.mark.parametrize("width", [0.05, 2.5, 0.1])
def test_a_value_on_the_bound_of_two_cells_is_in_the_upper_one(width: float) -> None:
    numbers = np.arange(-40, 400)
    bounds = np.array([round(int(number) * width, 9) for number in numbers])

    assert bins(bounds, width).tolist() == numbers.tolist()
    assert bins(np.nextafter(bounds, -np.inf), width).tolist() == (numbers - 1).tolist()
