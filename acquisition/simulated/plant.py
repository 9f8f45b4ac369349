"""The motion of one unit and what its transducers read, in chunks of fixed length."""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.chain import TransducerChain
from acquisition.simulated.conditions import Conditions, SlowWander
from acquisition.simulated.excitation import Excitation, HydraulicForce, RopeForce, UnbalanceForce
from acquisition.simulated.rotation import Rotation
from acquisition.simulated.scenario import Scenario
from acquisition.simulated.transducers import output_map
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
    first_index
        Samples since the plant began to warm up.
    """

    readings: FloatArray
    start: Conditions
    stop: Conditions
    first_index: int


class SimulatedPlant:
    """Rotor, forces and transducers of one unit, advancing chunk by chunk.

    Raises
    ------
    ConfigError
        If machine and scenario do not fit together.
    """

    def __init__(self, machine: Unit, scenario: Scenario, seed: int) -> None:
        seeds = np.random.SeedSequence(seed).spawn(7)
        hydraulic, rope, noise, wander, growth, speed, own = (
            np.random.Generator(np.random.SFC64(s)) for s in seeds
        )
        rate_hz = machine.rate_hz
        turn_hz = hz_from_rpm(scenario.speed_rpm)
        self._rotation = Rotation(
            speed, turn_hz, rate_hz, scenario.speed_wander, scenario.wander_time_s
        )
        self._rotor = _lifted_rotor(machine, scenario)
        self._state = np.zeros(self._rotor.transition.shape[0])
        self._forces = _excitations(scenario, rate_hz, self._rotation, hydraulic, rope)
        self._chain = TransducerChain(machine, scenario, noise, own)
        self._wander = SlowWander(wander, growth, machine, scenario, CHUNK_SAMPLES / rate_hz)
        self._index = 0
        standing = self._wander.now()
        for _ in range(int(WARM_UP_S * rate_hz / CHUNK_SAMPLES) + 1):
            self._readings(standing, standing)

    def advance(self) -> Chunk:
        """Produce the next chunk."""
        first_index = self._index
        start, stop = self._wander.now(), self._wander.advance()
        readings = self._readings(start, stop)
        self._chain.add_white_noise(readings)
        return Chunk(readings, start, stop, first_index)

    def relative_speed(self, chunk: Chunk, offset: int) -> float:
        """Speed at a sample of a chunk, over its mean."""
        return float(
            self._rotation.relative_speed(np.array([float(chunk.first_index + offset)]))[0]
        )

    def _readings(self, start: Conditions, stop: Conditions) -> FloatArray:
        index = np.arange(self._index, self._index + CHUNK_SAMPLES, dtype=np.float64)
        self._index += CHUNK_SAMPLES
        return self._chain.read(self._vibration(), self._rotation.turns(index), start, stop)

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
    parameters = scenario.true_rotor
    matrices = rotor_matrices(parameters, films, scenario.speed_rpm)
    forces = np.hstack([force_map(parameters, plane) for plane in _planes(scenario)])
    outputs = output_map(machine, parameters, matrices)
    rotor = discretize(matrices, forces, outputs, machine.rate_hz, Hold.RAMP)
    return lift(rotor, LIFTED_STEPS)


def _planes(scenario: Scenario) -> list[ForcePlane]:
    """Planes on which forces act, in order; every one costs time."""
    used = {ForcePlane.MASS_CENTRE, ForcePlane.RUNNER, scenario.hydraulic.plane}
    return [plane for plane in ForcePlane if plane in used]


def _excitations(
    scenario: Scenario,
    rate_hz: float,
    rotation: Rotation,
    hydraulic: np.random.Generator,
    rope: np.random.Generator,
) -> dict[ForcePlane, list[Excitation]]:
    turn_hz = hz_from_rpm(scenario.speed_rpm)
    unbalance_n = unbalance_force_n(scenario.unbalance_grade_mm_s, scenario.speed_rpm)
    noise, vortex = scenario.hydraulic, scenario.rope
    by_plane: dict[ForcePlane, list[Excitation]] = {plane: [] for plane in _planes(scenario)}
    by_plane[ForcePlane.MASS_CENTRE].append(UnbalanceForce(unbalance_n, rotation))
    by_plane[noise.plane].append(HydraulicForce(hydraulic, noise.rms_n, noise.cutoff_hz, rate_hz))
    by_plane[ForcePlane.RUNNER].append(
        RopeForce(rope, vortex.force_n, vortex.order * turn_hz, vortex.line_width_hz, rate_hz)
    )
    return by_plane
