"""Rotation of the shaft and forces on the rotor; both are independent of the requested lengths."""

import math
from typing import TypeAlias

import numpy as np

from acquisition.simulated.plant.rotor import ForcePlane, unbalance_force_n
from acquisition.simulated.plant.scenario import Scenario
from core.arrays import FloatArray
from core.units import hz_from_rpm

PARTS = ((0.5, 1.0), (0.3, 0.57), (0.2, 0.31))
"""Sines of the speed variation: share of total amplitude, and period divided by wander time."""

CUTOFF_FILTER_ORDER = 4
IMPULSE_SAMPLES_PER_CUTOFF_PERIOD = 20


class FollowedRotation:
    """Rotation of a shaft with a speed that is linear within each chunk.

    Methods accept only sample indices of the newest chunk.
    """

    def __init__(self, rated_speed_rpm: float, rate_hz: float) -> None:
        self._rated_speed_rpm = rated_speed_rpm
        self._turns_per_sample = hz_from_rpm(rated_speed_rpm) / rate_hz
        self._first, self._n_samples, self._turns = 0, 1, 0.0
        self._start, self._stop = 1.0, 1.0

    def follow(self, first: int, n_samples: int, start_rpm: float, stop_rpm: float) -> None:
        """Begin a chunk at sample `first`, with a linear speed from `start_rpm` to `stop_rpm`."""
        self._turns = float(self.turns(np.array([float(first)]))[0])
        self._first, self._n_samples = first, n_samples
        self._start = start_rpm / self._rated_speed_rpm
        self._stop = stop_rpm / self._rated_speed_rpm

    def relative_speed(self, index: FloatArray) -> FloatArray:
        """Return the ratio of speed to rated speed at sample indices, (n_samples,)."""
        share = (index - self._first) / self._n_samples
        return np.asarray(self._start + (self._stop - self._start) * share)

    def turns(self, index: FloatArray) -> FloatArray:
        """Return the angle since sample 0 in turns, (n_samples,)."""
        mean = 0.5 * (self._start + self.relative_speed(index))
        return np.asarray(self._turns + self._turns_per_sample * mean * (index - self._first))


class Rotation:
    """Rotation of a shaft with slowly varying speed, in closed form for any sample index.

    The variation is a sum of three slow sines, so that the angle is the exact integral of the
    speed, and the speed stays within its limits.

    Parameters
    ----------
    turn_hz, speed_wander
        Mean frequency of rotation, and maximum relative deviation from it.
    wander_time_s
        Period of the largest sine, in seconds.
    """

    def __init__(
        self,
        random: np.random.Generator,
        turn_hz: float,
        rate_hz: float,
        speed_wander: float = 0.0,
        wander_time_s: float = 600.0,
    ) -> None:
        self._turns_per_sample = turn_hz / rate_hz
        self._swings = [
            (
                speed_wander * share,
                2.0 * math.pi / (period * wander_time_s * rate_hz),
                random.uniform(0.0, 2.0 * math.pi),
            )
            for share, period in PARTS
        ]

    def relative_speed(self, index: FloatArray) -> FloatArray:
        """Return the ratio of speed to mean speed at sample indices, (n_samples,)."""
        relative = np.ones_like(index)
        for swing, step_rad, phase_rad in self._swings:
            relative += swing * np.cos(step_rad * index + phase_rad)
        return relative

    def turns(self, index: FloatArray) -> FloatArray:
        """Return the angle since sample 0 in turns, (n_samples,)."""
        evenly = index.copy()
        for swing, step_rad, phase_rad in self._swings:
            evenly += swing / step_rad * np.sin(step_rad * index + phase_rad)
        return np.asarray(self._turns_per_sample * evenly)


Turning: TypeAlias = FollowedRotation | Rotation
"""Rotation of a shaft as a function of the sample index."""


class UnbalanceForce:
    """Unbalance force: rotates with the shaft and is proportional to the square of the speed.

    `force_n` is the force at a relative speed of 1.
    """

    def __init__(self, force_n: float, rotation: Turning) -> None:
        self._force_n = force_n
        self._rotation = rotation
        self._index = 0

    def advance(self, n_samples: int) -> FloatArray:
        """Return the force (x, y) at the next samples in newtons, (2, n_samples)."""
        index = np.arange(self._index, self._index + n_samples, dtype=np.float64)
        self._index += n_samples
        angle = 2.0 * math.pi * np.fmod(self._rotation.turns(index), 1.0)
        return _rotating(self._force_n, angle) * self._rotation.relative_speed(index) ** 2


class RopeForce:
    """Force of the vortex rope: rotates forward at its own frequency, with random phase.

    The phase is a random walk. Its spectrum is a Lorentzian line with `line_width_hz` at half power
    (phase noise of a free oscillator: variance 2π · width · time).
    """

    def __init__(
        self,
        random: np.random.Generator,
        force_n: float,
        frequency_hz: float,
        line_width_hz: float,
        rate_hz: float,
    ) -> None:
        self._random = random
        self._force_n = force_n
        self._mean_step = 2.0 * math.pi * frequency_hz / rate_hz
        self._step_rms = math.sqrt(2.0 * math.pi * line_width_hz / rate_hz)
        self._angle = float(random.uniform(0.0, 2.0 * math.pi))

    def advance(self, n_samples: int) -> FloatArray:
        """Return the force (x, y) at the next samples in newtons, (2, n_samples)."""
        steps = self._mean_step + self._step_rms * self._random.standard_normal(n_samples)
        angle = np.cumsum(np.concatenate([[self._angle], steps]))
        self._angle = float(angle[-1]) % (2.0 * math.pi)
        return _rotating(self._force_n, angle[:-1])


class HydraulicForce:
    """Broadband hydraulic force: Gaussian, independent in x and y, low-pass filtered or white.

    The force is white if `cutoff_hz` is None.
    """

    def __init__(
        self, random: np.random.Generator, rms_n: float, cutoff_hz: float | None, rate_hz: float
    ) -> None:
        self._random = random
        self._sections = None if cutoff_hz is None else _low_pass(cutoff_hz, rate_hz)
        self._rms_n = rms_n
        self._filter_state = np.zeros((CUTOFF_FILTER_ORDER // 2, 2, 2))

    def advance(self, n_samples: int) -> FloatArray:
        """Return the force (x, y) at the next samples in newtons, (2, n_samples)."""
        import scipy.signal  # slow import, not needed at start-up

        force_n = self._rms_n * self._random.standard_normal((n_samples, 2)).T
        if self._sections is not None:
            force_n, self._filter_state = scipy.signal.sosfilt(
                self._sections, force_n, axis=1, zi=self._filter_state
            )
        return force_n


Excitation: TypeAlias = UnbalanceForce | RopeForce | HydraulicForce
"""Generator of a radial force on the rotor."""


def _rotating(force_n: float, angle_rad: FloatArray) -> FloatArray:
    return force_n * np.stack([np.cos(angle_rad), np.sin(angle_rad)])


def _low_pass(cutoff_hz: float, rate_hz: float) -> FloatArray:
    """Return second-order sections of a low-pass that preserves the rms of white noise."""
    import scipy.signal  # slow import, not needed at start-up

    sections: FloatArray = scipy.signal.butter(
        CUTOFF_FILTER_ORDER, cutoff_hz, fs=rate_hz, output="sos"
    )
    impulse = np.zeros(math.ceil(IMPULSE_SAMPLES_PER_CUTOFF_PERIOD * rate_hz / cutoff_hz))
    impulse[0] = 1.0
    response = scipy.signal.sosfilt(sections, impulse)
    sections[0, :3] /= math.sqrt(float(np.sum(response**2)))
    return sections


def force_planes(scenario: Scenario) -> list[ForcePlane]:
    """Return the planes on which forces act in a scenario, in the order of `ForcePlane`."""
    used = {ForcePlane.MASS_CENTRE, ForcePlane.RUNNER, scenario.hydraulic.plane}
    return [plane for plane in ForcePlane if plane in used]


class Forces:
    """All forces on the rotor: unbalance, broadband hydraulic force and vortex rope.

    Parameters
    ----------
    first
        Scenario of the first chunk. It sets the planes, the band of the hydraulic force, and the
        order and line width of the rope; later scenarios only change the size of the forces.
    rated_speed_rpm
        Speed at a relative speed of 1 of `rotation`.
    """

    def __init__(
        self,
        first: Scenario,
        rated_speed_rpm: float,
        rate_hz: float,
        rotation: Turning,
        hydraulic: np.random.Generator,
        rope: np.random.Generator,
    ) -> None:
        self._rated_speed_rpm = rated_speed_rpm
        noise, vortex = first.hydraulic, first.rope
        rope_hz = vortex.order * hz_from_rpm(rated_speed_rpm)
        of_one_newton: tuple[tuple[ForcePlane, Excitation], ...] = (
            (ForcePlane.MASS_CENTRE, UnbalanceForce(1.0, rotation)),
            (noise.plane, HydraulicForce(hydraulic, 1.0, noise.cutoff_hz, rate_hz)),
            (ForcePlane.RUNNER, RopeForce(rope, 1.0, rope_hz, vortex.line_width_hz, rate_hz)),
        )
        planes = force_planes(first)
        self._excitations = [(planes.index(p), excitation) for p, excitation in of_one_newton]
        self._n_planes = len(planes)

    def advance(self, n_samples: int, start: Scenario, stop: Scenario) -> FloatArray:
        """Return the forces at the next samples, during a linear transition between two scenarios.

        Returns
        -------
        (2 · n_planes, n_samples) in newtons: x and y of each plane.
        """
        total = np.zeros((self._n_planes, 2, n_samples))
        sizes = zip(self._sizes_n(start), self._sizes_n(stop), strict=True)
        for (plane, excitation), (from_n, to_n) in zip(self._excitations, sizes, strict=True):
            force = excitation.advance(n_samples)
            total[plane] += straight(from_n, to_n, n_samples) * force
        return total.reshape(2 * self._n_planes, n_samples)

    def _sizes_n(self, scenario: Scenario) -> tuple[float, float, float]:
        """Return the unbalance force at rated speed, the rms hydraulic force and the rope force."""
        grade_mm_s = scenario.unbalance_grade_mm_s
        return (
            unbalance_force_n(grade_mm_s, self._rated_speed_rpm),
            scenario.hydraulic.rms_n,
            scenario.rope.force_n,
        )


def straight(start: float, stop: float, n_samples: int) -> FloatArray | float:
    """Return a linear ramp (n_samples,) from `start` to just before `stop`; a number if equal."""
    if start == stop:
        return start
    return np.linspace(start, stop, n_samples, endpoint=False)
