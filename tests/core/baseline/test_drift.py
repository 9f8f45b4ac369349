"""Drift and scatter under like conditions are told from seasons, loads, position and chance."""

from collections.abc import Callable

import numpy as np
import pytest

from core.baseline.agreement import Drift, drift_within, learning_drift
from core.baseline.baseline import Origin
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.baseline.surface_fit import slope_scatter

FilmLife = Callable[..., StiffnessHistory]


def test_what_cells_are_like_and_a_few_wrong_days_are_no_drift() -> None:
    random = np.random.default_rng(1)
    day = np.repeat(np.arange(100), 5)
    cell = np.clip(day // 10 + random.integers(-2, 3, day.size), 0, 9)  # a season through the cells
    value = 0.5 * cell + random.normal(0.0, 0.01, day.size)
    found = drift_within(day, value, cell)
    assert found is not None
    assert abs(found.change) < 3.0 * found.std < 0.02
    random = np.random.default_rng(3)
    day = np.repeat(np.arange(100), 4)
    value = random.normal(0.0, 0.01, day.size)
    value[-4:] = -0.8
    found = drift_within(day, value, np.zeros(day.size, np.int64))
    assert found is not None
    assert abs(found.change) < 0.02
    day = np.arange(100)
    assert drift_within(day, -0.01 * day, day) is None


def test_drift_is_found_and_its_uncertainty_covers_it() -> None:
    random = np.random.default_rng(2)
    day = np.repeat(np.arange(120), 4)
    errors = []
    for _ in range(200):
        cell = random.integers(0, 20, day.size)
        alike = np.repeat(random.normal(0.0, 0.01, 15), 8)[day]  # spells that are alike
        value = 0.3 * cell - 0.05 * day / 119 + alike + random.normal(0.0, 0.01, day.size)
        found = drift_within(day, value, cell)
        assert found is not None
        errors.append((found.change + 0.05) / found.std)
    assert np.mean(np.abs(errors) < 2.0) > 0.85
    assert abs(np.mean(errors)) < 0.3


@pytest.mark.parametrize("size", [0.0, 0.1])
def test_a_baseline_tells_whether_its_film_changed_while_it_was_learned(
    film_life: FilmLife, size: float
) -> None:
    history = film_life(
        4, change=lambda hours: np.log(1.0 - size * np.clip(hours / 24 / 110, 0.0, 1.0))
    )
    settled = np.ones(len(history), np.bool_)
    origin = Origin("U1", "UJB", "dynamic", 1, "Ada", 0)
    learned = learn(history, settled, origin, BaselineSettings())
    drifts = [learning_drift(history, settled, quantity) for quantity in learned.quantities]
    for found in drifts:
        assert isinstance(found, Drift)
        assert abs(found.change - np.log(1.0 - size)) < max(4.0 * found.std, 0.03)
        assert (abs(found.change) > 3.0 * found.std) == (size > 0.0)


N = 4000


def test_scatter_is_put_down_to_position_if_slopes_differ_and_not_to_a_few_wrong_days() -> None:
    random = np.random.default_rng(1)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.006 * random.standard_normal(N) + 0.003 * slope * random.standard_normal(N)
    found = slope_scatter(slope, deviation)
    steep = np.array([5.0])
    assert np.sqrt(found.variance(steep)) == pytest.approx(np.hypot(0.006, 0.015), rel=0.1)
    assert np.sqrt(found.lasting(steep)) == pytest.approx(0.015, rel=0.15)
    assert found.lasting(np.array([0.0])) == 0.0
    random = np.random.default_rng(2)
    found = slope_scatter(np.full(N, 4.0), 0.01 * random.standard_normal(N))
    assert found.lasting(np.array([4.0])) == 0.0
    assert np.sqrt(found.variance(np.array([4.0]))) == pytest.approx(0.01, rel=0.1)
    random = np.random.default_rng(3)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.01 * random.standard_normal(N)
    deviation[:40] = 1.0
    found = slope_scatter(slope, deviation)
    assert np.sqrt(found.variance(np.array([3.0]))) == pytest.approx(0.01, rel=0.15)
