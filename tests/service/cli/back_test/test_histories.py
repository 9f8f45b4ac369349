"""Rows of readings become histories, or are refused with line and reason."""

from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from core.baseline.history import ReadingOutcome
from service.cli.offline.backtest_cells import LINE, TEXTS
from service.cli.offline.backtest_histories import histories_of

STEP_NS = 600_000_000_000
PLACES = {("U1", "UJB"), ("U1", "LJB"), ("U2", "UJB")}


def columns(n: int = 6) -> dict[str, Any]:
    """Rows of three bearings, both directions, mixed as a plant would write them."""
    rows = [(time, *place, d) for time in range(n) for place in sorted(PLACES) for d in "xy"]
    size = len(rows)
    return {
        "time_ns": [STEP_NS * time for time, *_ in rows],
        "unit": [row[1] for row in rows],
        "bearing": [row[2] for row in rows],
        "direction": [row[3] for row in rows],
        "k_n_per_m": [1e9 + row for row in range(size)],
        "u_random": [0.01] * size,
        "eccentricity_ratio": [0.3 + 0.01 * time for time, *_ in rows],
        "oil_temperature_c": [40.0 + time for time, *_ in rows],
        "quality": ["good"] * size,
        "state": ["part_load"] * size,
    }


def as_read(rows: dict[str, Any]) -> dict[str, Any]:
    """Columns as they come from the reading process; line 1 is the heading."""
    found = {
        key: pa.array(column).dictionary_encode() if key in TEXTS else np.array(column)
        for key, column in rows.items()
    }
    return found | {LINE: np.arange(2, len(rows["unit"]) + 2)}


def test_every_row_finds_its_place_and_a_direction_without_a_row_has_no_number() -> None:
    found = histories_of(as_read(columns()), PLACES)
    assert set(found) == PLACES
    assert np.exp(found["U2", "UJB"].history.ln_k) == pytest.approx(
        1e9 + np.array([[6 * time + 4 + side for time in range(6)] for side in (0, 1)])
    )
    assert found["U1", "LJB"].history.oil_temperature_c.tolist() == [40 + t for t in range(6)]
    rows = {key: column[:-1] for key, column in columns().items()}
    history = histories_of(as_read(rows))["U2", "UJB"].history
    assert np.isnan(history.ln_k[1, -1])
    assert history.outcome[:, -1].tolist() == [ReadingOutcome.MEASURED, ReadingOutcome.BAD_QUALITY]


def test_a_reading_that_is_not_good_has_no_number_but_its_reason() -> None:
    rows = columns()
    rows["quality"][0:2] = ["bad", "insufficient_excitation"]
    rows["k_n_per_m"][1] = float("nan")
    history = histories_of(as_read(rows))["U1", "LJB"].history
    assert history.outcome[:, 0].tolist() == [
        ReadingOutcome.BAD_QUALITY,
        ReadingOutcome.INSUFFICIENT_EXCITATION,
    ]
    assert np.isnan(history.ln_k[:, 0]).all()


@pytest.mark.parametrize(
    ("key", "row", "value", "says"),
    [
        ("unit", 3, "U9", "line 5: unknown unit 'U9'"),
        ("bearing", 4, "XJB", "line 6: unit U2 has no bearing 'XJB'"),
        ("direction", 0, "z", "line 2: unknown direction 'z'"),
        ("quality", 7, "fine", "line 9: unknown quality 'fine'"),
        ("state", 1, "resting", "line 3: unknown state 'resting'"),
        ("k_n_per_m", 5, -1.0, "line 7: k_n_per_m must be above 0, got -1.0"),
        ("k_n_per_m", 5, float("nan"), "line 7: k_n_per_m must be above 0, got nan"),
        ("k_n_per_m", 5, float("inf"), "line 7: k_n_per_m must be finite, got inf"),
        ("u_random", 5, 0.0, "line 7: u_random must be above 0, got 0.0"),
        ("oil_temperature_c", 2, float("inf"), "line 4: oil_temperature_c must be finite"),
        ("time_ns", 6, 0, "line 8: two rows have the same time"),
        ("time_ns", 12, 1, "line 14: time is earlier than in the previous row"),
        ("eccentricity_ratio", 1, 0.4, "line 3: eccentricity_ratio differs"),
        ("state", 1, "full_load", "line 3: state differs"),
    ],
)
def test_a_wrong_row_is_refused_with_its_line(key: str, row: int, value: object, says: str) -> None:
    rows = columns()
    rows[key][row] = value
    with pytest.raises(ValueError, match=says):
        histories_of(as_read(rows), PLACES)


def test_many_wrong_rows_are_refused_briefly() -> None:
    rows = columns()
    rows["quality"] = ["fine"] * len(rows["unit"])
    with pytest.raises(ValueError, match=r"line 11: .*; and 26 more"):
        histories_of(as_read(rows))
