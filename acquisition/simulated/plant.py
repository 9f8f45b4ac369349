"""The motion of one unit and what its transducers read, in chunks of fixed length."""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.conditions import Conditions, SlowWander
from acquisition.simulated.excitation import Excitation, HydraulicForce, RopeForce, UnbalanceForce
from acquisition.simulated.scenario import Scenario
from acquisition.simulated.transducers import noise_rms, output_map, standing_gap_um
from core.arrays import FloatArray
from core.machine import Unit
from core.rotor import force_map, rotor_matrices
from core.rotor_discrete import Hold, discretize
from core.rotor_parameters import ForcePlane, unbalance_force_n
from core.rotor_simulation import LiftedRotor, lift, simulate
from core.units import hz_from_rpm

LIFTED_STEPS = 32
CHUNK_SAMPLES = 64 * LIFTED_STEPS
"""Length of the pieces in which everything random is drawn, whatever pieces are asked for."""

WARM_UP_S = 15.0
"""Transients of films as soft as 0.3 GN/m have died to 1e-7 by then (7 % damping at 3 Hz)."""


@dataclass(frozen=True)
class Chunk:
    """CHUNK_SAMPLES of every channel and the conditions at both ends.

    Parameters
    ----------
    readings
        (n_channels, CHUNK_SAMPLES) in engineering units.
    """

    readings: FloatArray
    start: Conditions
    stop: Conditions


class SimulatedPlant:
    """Rotor, forces and transducers of one unit, advancing chunk by chunk.

    Raises
    ------
    ConfigError
        If machine and scenario do not fit together.
    """

    def __init__(self, machine: Unit, scenario: Scenario, seed: int) -> None:
        seeds = np.random.SeedSequence(seed).spawn(4)
        hydraulic, rope, noise, wander = (np.random.Generator(np.random.SFC64(s)) for s in seeds)
        self._machine = machine
        self._rotor = _lifted_rotor(machine, scenario)
        self._state = np.zeros(self._rotor.transition.shape[0])
        self._forces = _excitations(scenario, machine.rate_hz, hydraulic, rope)
        self._noise = noise
        self._noise_rms = noise_rms(machine, scenario.noise)
        self._wander = SlowWander(wander, machine, scenario, CHUNK_SAMPLES / machine.rate_hz)
        self._ramp = np.arange(CHUNK_SAMPLES) / CHUNK_SAMPLES
        for _ in range(int(WARM_UP_S * machine.rate_hz / CHUNK_SAMPLES) + 1):
            self._vibration()

    def advance(self) -> Chunk:
        """Produce the next chunk."""
        readings = self._vibration()
        start, stop = self._wander.now(), self._wander.advance()
        gap_um, next_gap_um = (standing_gap_um(self._machine, c) for c in (start, stop))
        readings += gap_um[:, np.newaxis]
        readings += np.outer(next_gap_um - gap_um, self._ramp)
        noise = self._noise.standard_normal(readings.shape, dtype=np.float32)
        readings += noise * self._noise_rms[:, np.newaxis]
        return Chunk(readings, start, stop)

    def _vibration(self) -> FloatArray:
        forces = np.concatenate(
            [
                sum((e.advance(CHUNK_SAMPLES) for e in excitations), np.zeros((2, CHUNK_SAMPLES)))
                for excitations in self._forces.values()
            ]
        )
        readings, self._state = simulate(self._rotor, self._state, forces)
        return readings


def _lifted_rotor(machine: Unit, scenario: Scenario) -> LiftedRotor:
    missing = {b.bearing for b in scenario.rotor.brackets} - scenario.bearings.keys()
    if missing:
        raise ConfigError(f"the scenario of {machine.id!r} lacks {', '.join(sorted(missing))}")
    films = {name: bearing.film for name, bearing in scenario.bearings.items()}
    matrices = rotor_matrices(scenario.rotor, films, scenario.speed_rpm)
    forces = np.hstack([force_map(scenario.rotor, plane) for plane in _planes(scenario)])
    outputs = output_map(machine, scenario.rotor, matrices)
    rotor = discretize(matrices, forces, outputs, machine.rate_hz, Hold.RAMP)
    return lift(rotor, LIFTED_STEPS)


def _planes(scenario: Scenario) -> list[ForcePlane]:
    """Planes on which forces act, in order; every one costs time."""
    used = {ForcePlane.MASS_CENTRE, ForcePlane.RUNNER, scenario.hydraulic.plane}
    return [plane for plane in ForcePlane if plane in used]


def _excitations(
    scenario: Scenario,
    rate_hz: float,
    hydraulic: np.random.Generator,
    rope: np.random.Generator,
) -> dict[ForcePlane, list[Excitation]]:
    turn_hz = hz_from_rpm(scenario.speed_rpm)
    unbalance_n = unbalance_force_n(scenario.unbalance_grade_mm_s, scenario.speed_rpm)
    noise, vortex = scenario.hydraulic, scenario.rope
    by_plane: dict[ForcePlane, list[Excitation]] = {plane: [] for plane in _planes(scenario)}
    by_plane[ForcePlane.MASS_CENTRE].append(UnbalanceForce(unbalance_n, turn_hz, rate_hz))
    by_plane[noise.plane].append(HydraulicForce(hydraulic, noise.rms_n, noise.cutoff_hz, rate_hz))
    by_plane[ForcePlane.RUNNER].append(
        RopeForce(rope, vortex.force_n, vortex.order * turn_hz, vortex.line_width_hz, rate_hz)
    )
    return by_plane
