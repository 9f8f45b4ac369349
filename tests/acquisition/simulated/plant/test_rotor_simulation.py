import numpy as np
import pytest

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import (
    ForcePlane,
    RotorParameters,
    bearing_response,
    bracket_motion,
    force_map,
    forward_force,
    relative_motion,
    rotor_matrices,
)
from acquisition.simulated.plant.rotor_steps import DiscreteRotor, discretize, lift, simulate
from core.arrays import FloatArray

PARAMETERS = RotorParameters()
FILMS = {
    "UJB": Film.proportional(0.69e9, 0.69e9),
    "LJB": Film.proportional(0.37e9, 0.37e9),
    "TJB": Film.proportional(1.5e9, 1.5e9),
}
MATRICES = rotor_matrices(PARAMETERS, FILMS, 92.3)
PLANES = tuple(ForcePlane)
RATE_HZ = 600.0


def discrete_rotor() -> DiscreteRotor:
    forces = np.hstack([force_map(PARAMETERS, plane) for plane in PLANES])
    displacement = np.vstack([relative_motion(PARAMETERS), bracket_motion(PARAMETERS)])
    outputs = np.hstack([displacement, np.zeros_like(displacement)])
    return discretize(MATRICES, forces, outputs, RATE_HZ)


def step_by_step(
    rotor: DiscreteRotor, state: FloatArray, forces: FloatArray
) -> tuple[FloatArray, FloatArray]:
    outputs = np.empty((rotor.output_map.shape[0], forces.shape[1]))
    for n in range(forces.shape[1]):
        outputs[:, n] = rotor.output_map @ state + rotor.feedthrough @ forces[:, n]
        state = rotor.transition @ state + rotor.input_map @ forces[:, n]
    return outputs, state


@pytest.mark.parametrize("n_steps", [1, 2, 32, 64])
def test_many_steps_at_once_equal_the_same_steps_one_by_one(n_steps):
    rotor = discrete_rotor()
    forces = 1.0e4 * np.random.default_rng(1).standard_normal((6, 1280))
    state = np.random.default_rng(2).standard_normal(20) * 1.0e-5

    expected, expected_state = step_by_step(rotor, state, forces)
    outputs, after = simulate(lift(rotor, n_steps), state, forces)

    assert np.abs(outputs - expected).max() <= 1e-11 * np.abs(expected).max()
    assert np.abs(after - expected_state).max() <= 1e-11 * np.abs(expected_state).max()


def test_a_held_force_settles_where_the_springs_balance_it():
    forces = np.zeros((6, 600 * 60))
    forces[4] = 1.0e5
    outputs, _ = simulate(lift(discrete_rotor(), 32), np.zeros(20), forces)

    pull = force_map(PARAMETERS, ForcePlane.RUNNER) @ np.array([1.0e5 + 0j, 0.0])
    response = bearing_response(PARAMETERS, MATRICES, 0.0, pull)
    static = np.concatenate(
        [
            part
            for half in (slice(0, 2), slice(2, 4))
            for part in (r[half] for r in response.values())
        ]
    ).real
    assert outputs[:, -1] == pytest.approx(static, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("plane", PLANES)
def test_steady_state_under_a_rotating_force_is_the_frequency_response(plane):
    frequency_hz = 92.3 / 60.0
    angle = 2.0 * np.pi * frequency_hz * np.arange(600 * 60) / RATE_HZ
    forces = np.zeros((6, angle.size))
    row = 2 * PLANES.index(plane)
    forces[row : row + 2] = 75.6e3 * np.array([np.cos(angle), np.sin(angle)])

    outputs, _ = simulate(lift(discrete_rotor(), 32), np.zeros(20), forces)

    force = forward_force(PARAMETERS, plane, 75.6e3)
    response = bearing_response(PARAMETERS, MATRICES, frequency_hz, force)
    end_s = np.arange(600 * 50, 600 * 60) / RATE_HZ
    for index, bracket in enumerate(PARAMETERS.brackets):
        phasor = response[bracket.bearing][:, np.newaxis]
        expected = (phasor * np.exp(2j * np.pi * frequency_hz * end_s)).real
        rows = [2 * index, 2 * index + 1, 6 + 2 * index, 7 + 2 * index]
        # Loss of a force in ramps over 1/600 s: (π f / rate)² / 3 = 2.2e-5
        assert np.abs(outputs[rows][:, 600 * 50 :] - expected).max() <= 3e-5 * np.abs(phasor).max()
