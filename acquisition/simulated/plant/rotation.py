"""The angle of the shaft: what unbalance and runout follow and the speed channel reports."""

import math
from typing import Protocol

import numpy as np

from core.arrays import FloatArray
from core.units import hz_from_rpm

PARTS = ((0.5, 1.0), (0.3, 0.57), (0.2, 0.31))
"""Share of the whole wander and period in wander times, of the swings that make it up."""


class Turning(Protocol):
    """How a shaft turns, by number of samples."""

    def relative_speed(self, index: FloatArray) -> FloatArray:
        """Speed over its mean or rated one at some samples, (n_samples,)."""
        ...

    def turns(self, index: FloatArray) -> FloatArray:
        """Whole and broken turns since sample 0, (n_samples,)."""
        ...


class FollowedRotation:
    """A shaft that follows any speed, in straight lines from chunk to chunk.

    Only samples of the newest chunk can be asked for.
    """

    def __init__(self, rated_speed_rpm: float, rate_hz: float) -> None:
        self._rated_speed_rpm = rated_speed_rpm
        self._turns_per_sample = hz_from_rpm(rated_speed_rpm) / rate_hz
        self._first, self._n_samples, self._turns = 0, 1, 0.0
        self._start, self._stop = 1.0, 1.0

    def follow(self, first: int, n_samples: int, start_rpm: float, stop_rpm: float) -> None:
        """Run from one speed to another within the next samples."""
        self._turns = float(self.turns(np.array([float(first)]))[0])
        self._first, self._n_samples = first, n_samples
        self._start = start_rpm / self._rated_speed_rpm
        self._stop = stop_rpm / self._rated_speed_rpm

    def relative_speed(self, index: FloatArray) -> FloatArray:
        """Speed over the rated one at some samples, (n_samples,)."""
        share = (index - self._first) / self._n_samples
        return np.asarray(self._start + (self._stop - self._start) * share)

    def turns(self, index: FloatArray) -> FloatArray:
        """Whole and broken turns since sample 0, (n_samples,)."""
        mean = 0.5 * (self._start + self.relative_speed(index))
        return np.asarray(self._turns + self._turns_per_sample * mean * (index - self._first))


class Rotation:
    """Turns of a shaft whose speed wanders slowly, as a closed function of the sample number.

    The wander is a sum of three slow swings, so that speed and angle belong together exactly and
    the speed never leaves its limits.

    Parameters
    ----------
    speed_wander
        Largest departure from the mean speed, as a share of it.
    wander_time_s
        Period of the largest swing.
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
        """Speed over its mean at some samples, (n_samples,)."""
        relative = np.ones_like(index)
        for swing, step_rad, phase_rad in self._swings:
            relative += swing * np.cos(step_rad * index + phase_rad)
        return relative

    def turns(self, index: FloatArray) -> FloatArray:
        """Whole and broken turns since sample 0, (n_samples,)."""
        evenly = index.copy()
        for swing, step_rad, phase_rad in self._swings:
            evenly += swing / step_rad * np.sin(step_rad * index + phase_rad)
        return np.asarray(self._turns_per_sample * evenly)
