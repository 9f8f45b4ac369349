"""Wander and lag."""

import numpy as np
import pytest

from acquisition.simulated.life.wander import lagged, wander


def test_wander_has_its_size_from_the_beginning_and_forgets_in_its_time() -> None:
    first = [wander(np.random.default_rng(i), 2, 1.0, 1e6, 1.0)[0] for i in range(2000)]
    assert np.std(first) == pytest.approx(1.0, rel=0.1)
    steps = wander(np.random.default_rng(1), 400_000, 600.0, 6000.0, 2.0)

    assert np.std(steps) == pytest.approx(2.0, rel=0.05)
    after_ten = np.corrcoef(steps[:-10], steps[10:])[0, 1]
    assert after_ten == pytest.approx(np.exp(-1.0), abs=0.03)


def test_a_lag_comes_63_percent_of_the_way_in_its_time_and_slower_when_it_is_slower() -> None:
    time_s = np.repeat([1000.0, 10_000.0], 10)
    followed = lagged(np.repeat([1.0, 0.0], 10), time_s, 100.0, 0.0)

    assert followed[9] == pytest.approx(1.0 - np.exp(-1.0))
    assert followed[19] == pytest.approx(followed[9] * np.exp(-0.1))
