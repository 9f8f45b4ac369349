"""The reduced rotor is the rotor."""

import numpy as np

from acquisition.simulated.life.order1 import order1_um_pk
from core.rotor import bearing_response, forward_force, rotor_matrices
from core.rotor_parameters import ForcePlane, RotorParameters, unbalance_force_n
from core.tilting_pad import FilmColumns


def test_eliminated_brackets_change_no_amplitude_and_no_phase() -> None:
    random = np.random.default_rng(3)
    rotor, n = RotorParameters(), 5
    films = {
        b.bearing: FilmColumns(*(s * random.uniform(0.2e9, 2e9, n) for s in (1.0, 0.2, 1.0)))
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
