"""Where pads and shaft are: what load, warmth and chance do to them."""

from collections.abc import Callable

import numpy as np
import pytest

from acquisition.simulated.life.bearing import LIFE_UJB, ThermalCourse
from acquisition.simulated.life.excitation import order1_um_pk
from acquisition.simulated.life.films import PadSetting, film_course
from acquisition.simulated.life.operation import lagged, wander
from acquisition.simulated.life.truth import UnitLife
from acquisition.simulated.plant.films import FilmColumns
from acquisition.simulated.plant.rotor import (
    ForcePlane,
    RotorParameters,
    bearing_response,
    forward_force,
    rotor_matrices,
    unbalance_force_n,
)

Life = Callable[..., UnitLife]


def test_the_field_of_the_generator_widens_a_bearing_one_way_and_narrows_it_the_other():
    usual, loaded = (
        film_course(
            LIFE_UJB,
            PadSetting(np.full(LIFE_UJB.ring.n_pads, LIFE_UJB.cold_clearance_um)),
            ThermalCourse(np.array([47.0]), np.array([165.0]), np.array([opening_um])),
            np.array([92.3]),
            np.zeros((2, 1)),
        )
        for opening_um in (0.0, 10.0)
    )

    np.testing.assert_allclose(loaded.clearance_um, usual.clearance_um)
    assert loaded.film.k_xx_n_per_m[0] < 0.98 * usual.film.k_xx_n_per_m[0]
    assert loaded.film.k_yy_n_per_m[0] > 1.02 * usual.film.k_yy_n_per_m[0]


def test_the_shaft_moves_along_a_line_and_a_hundredth_of_the_clearance_across(two_years):
    spread_um = np.sqrt(
        [np.linalg.eigvalsh(np.cov(two_years(n).truth["UJB"].centre_um)) for n in range(3)]
    )

    assert 40.0 < spread_um[0, 1] < 100.0
    assert 4.0 < np.mean(spread_um[:, 0]) < 6.0


def test_warm_clearance_wanders_by_micrometres_for_no_reason_that_is_measured(two_years):
    for seed in range(3):
        clearance_um = two_years(seed).truth["UJB"].clearance_um
        warm_um = clearance_um[clearance_um < np.median(clearance_um)]
        # half of a normal distribution: 0.6 times its standard deviation, here 1 µm
        assert 0.3 < np.std(warm_um) < 1.2


def test_eliminated_brackets_change_no_amplitude_and_no_phase():
    random = np.random.default_rng(3)
    rotor, n = RotorParameters(), 5
    films = {
        b.bearing: FilmColumns(
            *(s * random.uniform(0.2e9, 2e9, n) for s in (1.0, 0.2, 1.0)),
            random.uniform(1e6, 2e7, (3, n)),
            random.uniform(-2e8, 2e8, (3, n)),
            np.full(n, 0.014),
            np.full(n, 0.014 * 2.0 * np.pi * 90.9 / 60.0),
        )
        for b in rotor.brackets
    }
    grade_mm_s = random.uniform(0.5, 4.0, n)
    sound = {b.bearing: np.ones(n) for b in rotor.brackets}

    found = order1_um_pk(films, sound, 90.9, grade_mm_s, rotor)

    for row in range(n):
        at_row = {name: film.at(row) for name, film in films.items()}
        force_n = unbalance_force_n(float(grade_mm_s[row]), 90.9)
        force = forward_force(rotor, ForcePlane.MASS_CENTRE, force_n)
        matrices = rotor_matrices(rotor, at_row, 90.9)
        expected = bearing_response(rotor, matrices, 90.9 / 60.0, force)
        for name, phasors in expected.items():
            np.testing.assert_allclose(found[name][:, row], 1e6 * phasors, rtol=1e-9)


def test_wander_has_its_size_from_the_beginning_and_forgets_in_its_time():
    first = [wander(np.random.default_rng(i), 2, 1.0, 1e6, 1.0)[0] for i in range(2000)]
    assert np.std(first) == pytest.approx(1.0, rel=0.1)
    steps = wander(np.random.default_rng(1), 400_000, 600.0, 6000.0, 2.0)

    assert np.std(steps) == pytest.approx(2.0, rel=0.05)
    after_ten = np.corrcoef(steps[:-10], steps[10:])[0, 1]
    assert after_ten == pytest.approx(np.exp(-1.0), abs=0.03)


def test_a_lag_comes_63_percent_of_the_way_in_its_time_and_slower_when_it_is_slower():
    time_s = np.repeat([1000.0, 10_000.0], 10)
    followed = lagged(np.repeat([1.0, 0.0], 10), time_s, 100.0, 0.0)

    assert followed[9] == pytest.approx(1.0 - np.exp(-1.0))
    assert followed[19] == pytest.approx(followed[9] * np.exp(-0.1))
