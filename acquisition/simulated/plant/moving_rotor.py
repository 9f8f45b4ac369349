"""Rotor of a unit with time-varying oil films and brackets."""

import math
from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.excitation import force_planes
from acquisition.simulated.plant.films import Film, TiltLag
from acquisition.simulated.plant.probes import output_map
from acquisition.simulated.plant.rotor import force_map, rotor_matrices
from acquisition.simulated.plant.rotor_steps import LiftedRotor, discretize, lift, simulate
from acquisition.simulated.plant.scenario import Scenario
from core.arrays import FloatArray
from core.machine.unit import Unit
from core.units import rad_s_from_rpm

LIFTED_STEPS = 32

MIN_CHANGE = 1e-4
"""Relative change of a film or bracket above which the rotor matrices are recomputed."""

MAX_STEP, MAX_PIECES = 1e-3, 16
"""Maximum relative change of a film within one piece of a chunk, and maximum number of pieces.
The state is continuous at a change of the matrices. Only accelerometers show the resulting jump,
which is below their noise."""


class MovingRotor:
    """Rotor on time-varying films and brackets, which returns the motion at the transducers.

    Raises ConfigError if machine and scenario do not fit together.
    """

    def __init__(self, machine: Unit, scenario: Scenario) -> None:
        self._machine = machine
        self._rotor = _lifted_rotor(machine, scenario)
        self._coefficients = _coefficients(scenario)
        self._state = np.zeros(self._rotor.transition.shape[0])

    def advance(self, forces: FloatArray, start: Scenario, stop: Scenario) -> FloatArray:
        """Return the motion at the transducers during the transition between two scenarios.

        Parameters
        ----------
        forces
            (n_forces, n_samples) in newtons; n_samples is a multiple of `MAX_PIECES` times
            `LIFTED_STEPS`.

        Returns
        -------
        (n_channels, n_samples) in each channel's engineering unit.
        """
        change = _change(_coefficients(start), _coefficients(stop))
        n_pieces = min(MAX_PIECES, 2 ** max(0, math.ceil(math.log2(change / MAX_STEP + 1e-9))))
        readings = []
        for number, piece in enumerate(np.split(forces, n_pieces, axis=1)):
            self._follow(_between(start, stop, (number + 0.5) / n_pieces))
            part, self._state = simulate(self._rotor, self._state, piece)
            readings.append(part)
        return np.concatenate(readings, axis=1)

    def _follow(self, scenario: Scenario) -> None:
        """Set the films, brackets and speed of the following samples."""
        wanted = _coefficients(scenario)
        if _change(self._coefficients, wanted) > MIN_CHANGE:
            self._rotor, self._coefficients = _lifted_rotor(self._machine, scenario), wanted


def _coefficients(scenario: Scenario) -> FloatArray:
    """Return the coefficients of all films and brackets, and the speed, (n_bearings + 1, 9)."""
    return np.array([*_rows(scenario), 9 * (scenario.speed_rpm,)])


def _rows(scenario: Scenario) -> Iterator[tuple[float, ...]]:
    for bearing in scenario.bearings.values():
        film, omega = bearing.film, rad_s_from_rpm(scenario.speed_rpm)
        k_n_per_m = max(abs(film.k_xx_n_per_m), abs(film.k_yy_n_per_m))
        yield (
            *film.stiffness_n_per_m.ravel().tolist(),
            *(omega * film.damping_n_s_per_m).ravel().tolist(),
            k_n_per_m * bearing.bracket_stiffness_factor,
        )


def _change(before: FloatArray, after: FloatArray) -> float:
    """Return the largest change of a coefficient, divided by the largest coefficient of its row."""
    scale = np.maximum(np.max(np.abs(before), axis=1), np.max(np.abs(after), axis=1))
    change = np.max(np.abs(after - before), axis=1)
    return float(np.max(np.divide(change, scale, out=np.zeros_like(change), where=scale > 0.0)))


def _between(start: Scenario, stop: Scenario, share: float) -> Scenario:
    """Return `start` with films, brackets and speed interpolated linearly to `stop`."""
    if start is stop:
        return start
    bearings = {
        name: replace(
            bearing,
            film=_film_between(bearing.film, stop.bearings[name].film, share),
            bracket_stiffness_factor=(1.0 - share) * bearing.bracket_stiffness_factor
            + share * stop.bearings[name].bracket_stiffness_factor,
        )
        for name, bearing in start.bearings.items()
    }
    speed_rpm = (1.0 - share) * start.speed_rpm + share * stop.speed_rpm
    return replace(start, bearings=bearings, speed_rpm=speed_rpm)


def _film_between(start: Film, stop: Film, share: float) -> Film:
    """Return a film between two, which have the same pads."""
    mixed = {
        f.name: (1.0 - share) * np.array(getattr(start, f.name))
        + share * np.array(getattr(stop, f.name))
        for f in fields(Film)
    }
    lags = tuple(TiltLag(*lag) for lag in mixed.pop("lags").tolist())
    return Film(**{name: float(value) for name, value in mixed.items()}, lags=lags)


def _lifted_rotor(machine: Unit, scenario: Scenario) -> LiftedRotor:
    missing = {b.bearing for b in scenario.rotor.brackets} - scenario.bearings.keys()
    if missing:
        names = ", ".join(sorted(missing))
        raise ConfigError(f"add {names} to the scenario of unit {machine.id!r}: its rotor has them")
    films = {name: bearing.film for name, bearing in scenario.bearings.items()}
    parameters = scenario.true_rotor
    matrices = rotor_matrices(parameters, films, scenario.speed_rpm)
    forces = np.hstack([force_map(parameters, plane) for plane in force_planes(scenario)])
    outputs = output_map(machine, parameters, matrices)
    rotor = discretize(matrices, forces, outputs, machine.rate_hz)
    return lift(rotor, LIFTED_STEPS)
