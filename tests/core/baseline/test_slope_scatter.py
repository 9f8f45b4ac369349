"""What errors of the shaft's position do to stiffness, told from what strays everywhere."""

import numpy as np
import pytest

from core.baseline.slope_scatter import slope_scatter

N = 4000


def test_scatter_that_grows_with_the_slope_is_put_down_to_position() -> None:
    random = np.random.default_rng(1)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.006 * random.standard_normal(N) + 0.003 * slope * random.standard_normal(N)
    found = slope_scatter(slope, deviation)
    steep = np.array([5.0])
    assert np.sqrt(found.variance(steep)) == pytest.approx(np.hypot(0.006, 0.015), rel=0.1)
    assert np.sqrt(found.lasting(steep)) == pytest.approx(0.015, rel=0.15)
    assert found.lasting(np.array([0.0])) == 0.0


def test_slopes_that_are_all_alike_say_nothing_of_position() -> None:
    random = np.random.default_rng(2)
    found = slope_scatter(np.full(N, 4.0), 0.01 * random.standard_normal(N))
    assert found.lasting(np.array([4.0])) == 0.0
    assert np.sqrt(found.variance(np.array([4.0]))) == pytest.approx(0.01, rel=0.1)


def test_a_few_wrong_days_do_not_widen_what_is_normal() -> None:
    random = np.random.default_rng(3)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.01 * random.standard_normal(N)
    deviation[:40] = 1.0
    found = slope_scatter(slope, deviation)
    assert np.sqrt(found.variance(np.array([3.0]))) == pytest.approx(0.01, rel=0.15)
