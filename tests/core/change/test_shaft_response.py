"""How a machine's shaft answers to the stiffness of its films."""

from dataclasses import replace

import numpy as np
import pytest

from core.baseline.history import StiffnessHistory
from core.change.shaft_response import ShaftResponse, film_columns, learn_response

N = 3000


def histories(seed: int, outliers: float = 0.0) -> dict[str, StiffnessHistory]:
    """Two bearings; the first one's shaft motion falls by half of what its stiffness rises."""
    random = np.random.default_rng(seed)
    ln_k = 20.0 + random.normal(0.0, 0.3, (4, N))
    unbalance = random.normal(0.0, 0.2, N)
    ln_shaft = 4.0 + unbalance - 0.5 * (ln_k - 20.0) + 0.1 * (ln_k - 20.0) ** 2
    ln_shaft += random.normal(0.0, 0.01, ln_k.shape)
    ln_shaft += np.where(random.random(ln_k.shape) < outliers, 1.0, 0.0)
    one, pair = np.ones(N), np.full((2, N), 0.01)
    return {
        name: StiffnessHistory(
            *(np.arange(N), one, one, one, one, one, one, ln_k[rows], pair),
            *(np.exp(ln_shaft[rows]), np.exp(ln_shaft[rows])),
        )
        for name, rows in (("UJB", slice(0, 2)), ("LJB", slice(2, 4)))
    }


def learned(seed: int, outliers: float = 0.0) -> ShaftResponse:
    found = learn_response(histories(seed, outliers), np.ones(N, np.bool_))
    assert found is not None
    return found


def test_shares_follow_from_stiffness_and_wrong_or_too_few_readings_teach_nothing() -> None:
    ln_k, ln_shaft = film_columns(histories(2))
    left = ln_shaft - np.mean(ln_shaft, axis=0) - learned(1).expected(ln_k)
    assert np.std(left) == pytest.approx(0.01, rel=0.2)
    assert np.mean(left, axis=1) == pytest.approx(0.0, abs=1e-3)
    ln_k, _ = film_columns(histories(2))
    shift = learned(1, outliers=0.05).expected(ln_k) - learned(1).expected(ln_k)
    assert np.max(np.abs(np.median(shift, axis=1))) < 0.002
    assert learn_response(histories(1), np.arange(N) < 500) is None


def test_a_response_needs_bearings_read_at_the_same_times() -> None:
    found = histories(1)
    found["LJB"] = replace(found["LJB"], time_ns=found["LJB"].time_ns + 1)
    with pytest.raises(ValueError, match="LJB are not at the times"):
        learn_response(found, np.ones(N, np.bool_))
