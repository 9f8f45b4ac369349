"""Where pads and shaft are: what load, warmth and chance do to them."""

from collections.abc import Callable

import numpy as np

from acquisition.simulated.life.films import even_setting, film_course
from acquisition.simulated.life.life_bearing import LIFE_UJB
from acquisition.simulated.life.life_truth import UnitLife
from acquisition.simulated.life.thermal import ThermalCourse

Life = Callable[..., UnitLife]


def test_the_field_of_the_generator_widens_a_bearing_one_way_and_narrows_it_the_other() -> None:
    usual, loaded = (
        film_course(
            LIFE_UJB,
            even_setting(LIFE_UJB),
            ThermalCourse(np.array([47.0]), np.array([165.0]), np.array([opening_um])),
            np.array([92.3]),
            np.zeros((2, 1)),
        )
        for opening_um in (0.0, 10.0)
    )

    np.testing.assert_allclose(loaded.clearance_um, usual.clearance_um)
    assert loaded.film.k_xx_n_per_m[0] < 0.98 * usual.film.k_xx_n_per_m[0]
    assert loaded.film.k_yy_n_per_m[0] > 1.02 * usual.film.k_yy_n_per_m[0]


def test_the_shaft_moves_along_a_line_and_a_hundredth_of_the_clearance_across(
    two_years: Life,
) -> None:
    spread_um = np.sqrt(
        [np.linalg.eigvalsh(np.cov(two_years(n).truth["UJB"].centre_um)) for n in range(3)]
    )

    assert 40.0 < spread_um[0, 1] < 100.0
    assert 4.0 < np.mean(spread_um[:, 0]) < 6.0


def test_warm_clearance_wanders_by_micrometres_for_no_reason_that_is_measured(
    two_years: Life,
) -> None:
    for seed in range(3):
        clearance_um = two_years(seed).truth["UJB"].clearance_um
        warm_um = clearance_um[clearance_um < np.median(clearance_um)]
        # half of a normal distribution: 0.6 times its standard deviation, here 1 µm
        assert 0.3 < np.std(warm_um) < 1.2
