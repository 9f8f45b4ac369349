import numpy as np
import pytest

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import (
    ForcePlane,
    RotorParameters,
    bearing_response,
    force_map,
    rotor_matrices,
)

PARAMETERS = RotorParameters()
CROSS_COUPLED = Film(0.7e9, -0.2e9, 0.1e9, 0.5e9, 8e6, 1e6, -2e6, 7e6)
FILMS = {
    "UJB": CROSS_COUPLED,
    "LJB": Film.proportional(0.37e9, 0.4e9, -0.05e9),
    "TJB": Film.proportional(1.5e9, 1.5e9),
}
ISOTROPIC = {name: Film.proportional(1.0e9, 1.0e9) for name in FILMS}


def test_mass_and_stiffness_are_symmetric_and_a_bearing_without_a_film_is_refused():
    films = FILMS | {"UJB": Film.proportional(3.33e9, 1.11e9, -0.33e9)}
    matrices = rotor_matrices(PARAMETERS, films, 92.3)

    assert np.array_equal(matrices.mass, matrices.mass.T)
    assert np.allclose(matrices.stiffness, matrices.stiffness.T, rtol=1e-15)
    assert np.linalg.eigvalsh(matrices.mass).min() > 0.0
    assert np.linalg.eigvalsh(matrices.stiffness).min() > 0.0

    gyroscopic = rotor_matrices(PARAMETERS, FILMS, 92.3).gyroscopic

    assert np.array_equal(gyroscopic, -gyroscopic.T)
    assert np.abs(gyroscopic).max() == PARAMETERS.polar_inertia_kg_m2

    with pytest.raises(KeyError, match="TJB"):
        rotor_matrices(PARAMETERS, {"UJB": CROSS_COUPLED, "LJB": CROSS_COUPLED}, 92.3)


@pytest.mark.parametrize("frequency_hz", [0.1, 0.385, 1.538, 4.0, 20.0])
@pytest.mark.parametrize("plane", ForcePlane)
def test_film_and_bracket_are_related_whatever_excites_the_rotor(frequency_hz, plane):
    matrices = rotor_matrices(PARAMETERS, FILMS, 92.3)
    force = force_map(PARAMETERS, plane) @ np.array([1.0e4 + 3.0e3j, -2.0e3 + 5.0e3j])
    response = bearing_response(PARAMETERS, matrices, frequency_hz, force)
    omega = 2.0 * np.pi * frequency_hz

    for bracket in PARAMETERS.brackets:
        film = FILMS[bracket.bearing]
        shaft, bearing = np.split(response[bracket.bearing], 2)
        film_force = (film.stiffness_n_per_m + 1j * omega * film.damping_n_s_per_m) @ shaft
        bracket_force = (bracket.stiffness_n_per_m - bracket.mass_kg * omega**2) * bearing
        assert bracket_force == pytest.approx(film_force, rel=1e-11)


def test_a_pull_at_the_runner_moves_the_turbine_bearing_most_unless_the_seals_hold_it():
    matrices = rotor_matrices(PARAMETERS, ISOTROPIC, 92.3)
    pull_y = force_map(PARAMETERS, ForcePlane.RUNNER) @ np.array([0.0, 1.0e5 + 0j])

    response = bearing_response(PARAMETERS, matrices, 0.0, pull_y)

    assert response["TJB"][1].real > abs(response["LJB"][1]) > 0.0
    assert abs(response["TJB"][0]) < 1e-12

    force = force_map(PARAMETERS, ForcePlane.RUNNER) @ np.array([1.0e5 + 0j, 0.0])
    stiff = RotorParameters(seal_stiffness_n_per_m=1.0e13)
    response = bearing_response(stiff, rotor_matrices(stiff, FILMS, 92.3), 0.0, force)

    assert all(np.abs(motion).max() < 1e-7 for motion in response.values())


def test_an_excited_generator_pulls_the_shaft_further_off_centre():
    excited = RotorParameters(magnetic_stiffness_n_per_m=-0.6e9)
    force = force_map(PARAMETERS, ForcePlane.GENERATOR) @ np.array([1.0e5 + 0j, 0.0])
    deflection = {
        p.magnetic_stiffness_n_per_m: bearing_response(
            p, rotor_matrices(p, FILMS, 92.3), 0.0, force
        )["UJB"][0].real
        for p in (PARAMETERS, excited)
    }

    assert deflection[-0.6e9] > deflection[0.0] > 0.0
