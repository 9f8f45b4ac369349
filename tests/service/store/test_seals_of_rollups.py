"""What is damaged is in no roll-up, and puts no number where it does not belong."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import gather_all
from rigs.store_fixtures import Execute

from service.store.port import TrendQuery
from service.store.seals.damage import Place
from service.store.sqlite import SqliteStore

MINUTE_NS, HOUR_NS = 60_000_000_000, 3_600_000_000_000
T0 = 1_767_225_600_000_000_000
N_HOURS = 3


@pytest.fixture
def store(path: Path) -> Iterator[SqliteStore]:
    """One reading a minute, of as many turns a minute as minutes have passed."""
    with closing(SqliteStore(path)) as opened:
        readings = [
            assessment(T0 + n * MINUTE_NS, speed_rpm=float(n)) for n in range(60 * N_HOURS + 1)
        ]
        opened.append(readings, [])
        yield opened


def extremes(store: SqliteStore) -> list[tuple[float, float]]:
    """Least and greatest speed of each hour that is gathered."""
    asked = TrendQuery(
        *("U1", "UJB", ("speed_rpm",), T0, T0 + N_HOURS * HOUR_NS, N_HOURS + 1, HOUR_NS)
    )
    found = store.trend(asked).series["speed_rpm"]
    return list(zip(found.minimum, found.maximum, strict=True))  # type: ignore[arg-type]


def test_a_damaged_reading_is_in_no_roll_up_and_is_counted(
    store: SqliteStore, execute: Execute
) -> None:
    for minute in (0, 119):  # in what was not read since it was written
        execute(
            "UPDATE assessment SET reading_values = zeroblob(length(reading_values))"
            " WHERE time_ns = ?",
            (T0 + minute * MINUTE_NS,),
        )

    gather_all(store)

    assert store.integrity.damaged == [
        Place("assessment", f"series 1, time_ns {T0 + minute * MINUTE_NS}") for minute in (0, 119)
    ]
    assert extremes(store) == [(1.0, 59.0), (60.0, 118.0), (120.0, 179.0)]


def test_a_damaged_roll_up_is_not_gathered_into_a_wider_one(
    store: SqliteStore, execute: Execute
) -> None:
    gather_all(store, T0 + 30 * MINUTE_NS)
    execute("UPDATE rollup_cell SET n_readings = 1 WHERE width_s = 600 AND start_ns = ?", (T0,))

    gather_all(store)

    assert [place.table for place in store.integrity.damaged] == ["rollup_cell"]
    assert extremes(store) == [(10.0, 59.0), (60.0, 119.0), (120.0, 179.0)]


@pytest.mark.parametrize("hour", range(N_HOURS))
def test_numbers_whose_cell_is_damaged_are_not_taken_for_those_of_another(
    store: SqliteStore, execute: Execute, hour: int
) -> None:
    gather_all(store)
    right = extremes(store)
    execute(
        "UPDATE rollup_cell SET oil_low_c = 1.0 WHERE width_s = 3600 AND start_ns = ?",
        (T0 + hour * HOUR_NS,),
    )

    left = [found for found in extremes(store) if found[0] is not None]
    assert left == right[:hour] + right[hour + 1 :]
