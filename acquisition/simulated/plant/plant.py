"""Readings of the transducers of one simulated unit, in chunks of fixed length."""

from dataclasses import dataclass

import numpy as np

from acquisition.simulated.plant.chain import TransducerChain
from acquisition.simulated.plant.conditions import Conditions, SlowWander
from acquisition.simulated.plant.excitation import FollowedRotation, Forces, Rotation
from acquisition.simulated.plant.moving_rotor import LIFTED_STEPS, MovingRotor
from acquisition.simulated.plant.scenario import Course, Scenario
from core.arrays import FloatArray
from core.machine.unit import Unit
from core.units import hz_from_rpm

CHUNK_SAMPLES = 64 * LIFTED_STEPS
"""Number of samples that are simulated together, so that random numbers do not depend on the
requested block lengths."""

WARM_UP_S = 15.0
"""Simulated time before the first chunk, in which transients decay: to 1e-7 with films of 0.3 GN/m
(7 % damping at 3 Hz)."""


@dataclass(frozen=True)
class Chunk:
    """Readings of all channels over `CHUNK_SAMPLES`, with the conditions at both ends.

    Parameters
    ----------
    readings
        (n_channels, CHUNK_SAMPLES) in engineering units.
    start, stop
        Conditions at the first sample, and one sample after the last.
    first_index
        Index of the first sample, counted from the start of the warm-up.
    scenario
        Scenario at the first sample.
    """

    readings: FloatArray
    start: Conditions
    stop: Conditions
    first_index: int
    scenario: Scenario


class SimulatedPlant:
    """Simulation of rotor, forces and transducers of one unit, chunk by chunk.

    `course` is a `Scenario` for steady operation, or a course of scenarios.

    Raises ConfigError if machine and scenario do not fit together.
    """

    def __init__(self, machine: Unit, course: Course, seed: int) -> None:
        seeds = np.random.SeedSequence(seed).spawn(7)
        hydraulic, rope, noise, wander, growth, speed, own = (
            np.random.Generator(np.random.SFC64(s)) for s in seeds
        )
        self._course, self._rate_hz = course, machine.rate_hz
        self._scenario = first = course.at(0.0)
        rated_rpm = course.rated_speed_rpm
        self._rotation = _rotation(course, first, machine.rate_hz, speed)
        self._rotor = MovingRotor(machine, first)
        self._forces = Forces(first, rated_rpm, machine.rate_hz, self._rotation, hydraulic, rope)
        self._chain = TransducerChain(machine, first, noise, own)
        self._wander = SlowWander(wander, growth, machine, first, CHUNK_SAMPLES / machine.rate_hz)
        self._index = 0
        standing = self._wander.now(first)
        for _ in range(int(WARM_UP_S * machine.rate_hz / CHUNK_SAMPLES) + 1):
            self._readings(first, standing, standing)
        self._warm_index = self._index

    def advance(self) -> Chunk:
        """Simulate and return the next chunk."""
        first_index, scenario = self._index, self._scenario
        elapsed_s = (first_index + CHUNK_SAMPLES - self._warm_index) / self._rate_hz
        start, following = self._wander.now(scenario), self._course.at(elapsed_s)
        self._wander.advance()
        stop = self._wander.now(following)
        readings = self._readings(following, start, stop)
        self._chain.add_white_noise(readings)
        return Chunk(readings, start, stop, first_index, scenario)

    def speed_rpm(self, chunk: Chunk, offset: int) -> float:
        """Return the speed in r/min at the sample `offset` of `chunk`, which must be the newest."""
        index = np.array([float(chunk.first_index + offset)])
        return self._course.rated_speed_rpm * float(self._rotation.relative_speed(index)[0])

    def _readings(self, following: Scenario, start: Conditions, stop: Conditions) -> FloatArray:
        """Return the readings of a transition to `following`, without white noise."""
        index = np.arange(self._index, self._index + CHUNK_SAMPLES, dtype=np.float64)
        if isinstance(self._rotation, FollowedRotation):
            speeds_rpm = self._scenario.speed_rpm, following.speed_rpm
            self._rotation.follow(self._index, CHUNK_SAMPLES, *speeds_rpm)
        self._index += CHUNK_SAMPLES
        forces = self._forces.advance(CHUNK_SAMPLES, self._scenario, following)
        motion = self._rotor.advance(forces, self._scenario, following)
        self._scenario = following
        return self._chain.read(motion, self._rotation.turns(index), start, stop)


def _rotation(
    course: Course, first: Scenario, rate_hz: float, random: np.random.Generator
) -> Rotation | FollowedRotation:
    if course is not first:
        return FollowedRotation(course.rated_speed_rpm, rate_hz)
    turn_hz = hz_from_rpm(first.speed_rpm)
    return Rotation(random, turn_hz, rate_hz, first.speed_wander, first.wander_time_s)
