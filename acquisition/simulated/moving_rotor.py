"""The rotor of a unit on films and brackets that change while it moves."""

from collections.abc import Iterator

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.forces import force_planes
from acquisition.simulated.scenario import Scenario
from acquisition.simulated.transducers import output_map
from core.arrays import FloatArray
from core.machine import Unit
from core.rotor import force_map, rotor_matrices
from core.rotor_discrete import Hold, discretize
from core.rotor_simulation import LiftedRotor, lift, simulate

LIFTED_STEPS = 32

LEAST_CHANGE = 1e-4
"""Relative change of a film or bracket that is worth a new rotor. The motion goes on from where it
is: a step so small is lost in the noise of accelerometers, the only ones that could see it."""


class MovingRotor:
    """Motion of a rotor as its transducers see it.

    Raises
    ------
    ConfigError
        If machine and scenario do not fit together.
    """

    def __init__(self, machine: Unit, scenario: Scenario) -> None:
        self._machine = machine
        self._rotor = _lifted_rotor(machine, scenario)
        self._coefficients = _coefficients(scenario)
        self._state = np.zeros(self._rotor.transition.shape[0])

    def follow(self, scenario: Scenario) -> None:
        """Take the films, brackets and speed of a scenario from the next sample on."""
        wanted = _coefficients(scenario)
        scale = np.max(np.abs(wanted), axis=1, keepdims=True)
        if np.all(np.abs(wanted - self._coefficients) <= LEAST_CHANGE * scale):
            return
        self._rotor, self._coefficients = _lifted_rotor(self._machine, scenario), wanted

    def advance(self, forces: FloatArray) -> FloatArray:
        """Move under the next forces.

        Parameters
        ----------
        forces
            (n_forces, n_samples), n_samples a multiple of `LIFTED_STEPS`.

        Returns
        -------
        (n_channels, n_samples) in each channel's engineering unit.
        """
        readings, self._state = simulate(self._rotor, self._state, forces)
        return readings


def _coefficients(scenario: Scenario) -> FloatArray:
    """(n_bearings + 1, 5) of every film with its bracket, and the speed."""
    return np.array([*_rows(scenario), 5 * (scenario.speed_rpm,)])


def _rows(scenario: Scenario) -> Iterator[tuple[float, ...]]:
    for bearing in scenario.bearings.values():
        film = bearing.film
        k_n_per_m = max(abs(film.k_xx_n_per_m), abs(film.k_yy_n_per_m))
        yield (
            film.k_xx_n_per_m,
            film.k_xy_n_per_m,
            film.k_yx_n_per_m,
            film.k_yy_n_per_m,
            k_n_per_m * bearing.bracket_stiffness_factor,
        )


def _lifted_rotor(machine: Unit, scenario: Scenario) -> LiftedRotor:
    missing = {b.bearing for b in scenario.rotor.brackets} - scenario.bearings.keys()
    if missing:
        raise ConfigError(f"the scenario of {machine.id!r} lacks {', '.join(sorted(missing))}")
    films = {name: bearing.film for name, bearing in scenario.bearings.items()}
    parameters = scenario.true_rotor
    matrices = rotor_matrices(parameters, films, scenario.speed_rpm)
    forces = np.hstack([force_map(parameters, plane) for plane in force_planes(scenario)])
    outputs = output_map(machine, parameters, matrices)
    rotor = discretize(matrices, forces, outputs, machine.rate_hz, Hold.RAMP)
    return lift(rotor, LIFTED_STEPS)
