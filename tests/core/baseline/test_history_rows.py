"""Rows of readings become histories, or are refused with line and reason."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.baseline.history_rows import histories_from_columns
from core.change.backtest import operation_history, operation_of_states
from core.condition.operating_state import OperatingLimits, OperatingState

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


def test_every_row_finds_its_place_and_a_direction_without_a_row_has_no_number() -> None:
    found = histories_from_columns(columns(), PLACES)
    assert set(found) == PLACES
    assert np.exp(found["U2", "UJB"].history.ln_k) == pytest.approx(
        1e9 + np.array([[6 * time + 4 + side for time in range(6)] for side in (0, 1)])
    )
    assert found["U1", "LJB"].history.oil_temperature_c.tolist() == [40 + t for t in range(6)]
    rows = {key: column[:-1] for key, column in columns().items()}
    history = histories_from_columns(rows)["U2", "UJB"].history
    assert np.isnan(history.ln_k[1, -1])
    assert history.outcome[:, -1].tolist() == [ReadingOutcome.MEASURED, ReadingOutcome.BAD_QUALITY]


def test_a_reading_that_is_not_good_has_no_number_but_its_reason() -> None:
    rows = columns()
    rows["quality"][0:2] = ["bad", "insufficient_excitation"]
    rows["k_n_per_m"][1] = float("nan")
    history = histories_from_columns(rows)["U1", "LJB"].history
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
        ("k_n_per_m", 5, -1.0, "line 7: k_n_per_m must be above 0, not -1.0"),
        ("k_n_per_m", 5, float("nan"), "line 7: k_n_per_m must be above 0, not nan"),
        ("k_n_per_m", 5, float("inf"), "line 7: k_n_per_m must be finite, not inf"),
        ("u_random", 5, 0.0, "line 7: u_random must be above 0, not 0.0"),
        ("oil_temperature_c", 2, float("inf"), "line 4: oil_temperature_c must be finite"),
        ("time_ns", 6, 0, "line 8: the same time twice"),
        ("time_ns", 12, 1, "line 14: earlier than the row before"),
        ("eccentricity_ratio", 1, 0.4, "line 3: eccentricity_ratio differs"),
        ("state", 1, "full_load", "line 3: state differs"),
    ],
)
def test_a_wrong_row_is_refused_with_its_line(key: str, row: int, value: object, says: str) -> None:
    rows = columns()
    rows[key][row] = value
    with pytest.raises(ValueError, match=says):
        histories_from_columns(rows, PLACES)


def test_many_or_missing_or_unknown_or_uneven_columns_are_refused_briefly() -> None:
    rows = columns()
    rows["quality"] = ["fine"] * len(rows["unit"])
    with pytest.raises(ValueError, match=r"line 11: .*; and 26 more"):
        histories_from_columns(rows)
    rows = columns()
    with pytest.raises(ValueError, match="missing columns: unit, u_random"):
        histories_from_columns({k: c for k, c in rows.items() if k not in ("unit", "u_random")})
    with pytest.raises(ValueError, match="unknown columns: colour"):
        histories_from_columns({**rows, "colour": rows["unit"]})
    with pytest.raises(ValueError, match="unequal length"):
        histories_from_columns({**rows, "state": ["part_load"]})
    with pytest.raises(ValueError, match=r"power_mw: shape \(4,\), expected \(5,\)"):
        replace(history(), power_mw=np.ones(4))


def test_states_that_are_told_settle_as_those_that_are_followed() -> None:
    n = 300
    power_mw = np.where(np.arange(n) % 120 < 90, 200.0, 320.0)
    speed_rpm = np.where(np.arange(n) > 200, np.where(np.arange(n) > 210, 92.3, 0.0), 92.3)
    time_ns = STEP_NS * np.arange(n)
    limits = OperatingLimits(rated_speed_rpm=92.3, rated_power_mw=330.0)
    followed = operation_history(time_ns, speed_rpm, power_mw, limits)
    told = operation_of_states(time_ns, followed.state, limits)
    assert told.is_settled.tolist() == followed.is_settled.tolist()
    assert 0 < np.sum(told.is_settled) < n
    assert set(followed.state.tolist()) > {OperatingState.PART_LOAD, OperatingState.STANDSTILL}


def history(n: int = 5) -> StiffnessHistory:
    one, pair = np.ones(n), np.ones((2, n))
    return StiffnessHistory(
        *(np.arange(n), one, one, one, one, one, one),
        *(20.0 * pair, 0.01 * pair, 50.0 * pair, 20.0 * pair),
    )


def test_a_part_of_a_history_is_a_history_and_a_missing_number_says_why() -> None:
    whole = history()
    assert whole.rows(1, 3).time_ns.tolist() == [1, 2]
    assert len(whole.rows(2, 2)) == 0
    ln_k = history().ln_k.copy()
    ln_k[1, 2] = np.nan
    columns = {**vars(whole), "ln_k": ln_k}
    del columns["outcome"]
    assert StiffnessHistory(**columns).outcome[1].tolist() == [
        0,
        0,
        ReadingOutcome.BAD_QUALITY,
        0,
        0,
    ]


@pytest.mark.parametrize(
    ("column", "row", "value", "says"),
    [
        ("time_ns", 2, 1, "time_ns: row 2 is not after row 1"),
        ("oil_temperature_c", 3, np.inf, "oil_temperature_c: row 3 is infinite"),
        ("ln_k", (0, 4), np.nan, "outcome: row 4 contradicts ln_k"),
        ("outcome", (0, 4), ReadingOutcome.BAD_QUALITY, "outcome: row 4 contradicts ln_k"),
        ("u_random", (1, 0), 0.0, "u_random: row 0 must be above 0"),
    ],
)
def test_impossible_columns_are_refused_with_their_row(
    column: str, row: int | tuple[int, int], value: float, says: str
) -> None:
    wrong = getattr(history(), column).copy()
    wrong[row] = value
    with pytest.raises(ValueError, match=says):
        replace(history(), **{column: wrong})
