"""Columns of readings are checked."""

from dataclasses import replace

import numpy as np
import pytest

from core.baseline.history import ReadingOutcome, StiffnessHistory


def history(n: int = 5) -> StiffnessHistory:
    one, pair = np.ones(n), np.ones((2, n))
    return StiffnessHistory(
        *(np.arange(n), one, one, one, one, one, one),
        *(20.0 * pair, 0.01 * pair, 50.0 * pair, 20.0 * pair),
    )


def test_columns_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match=r"power_mw: shape \(4,\), expected \(5,\)"):
        replace(history(), power_mw=np.ones(4))


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
