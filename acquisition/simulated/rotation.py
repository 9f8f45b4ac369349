"""The angle of the shaft: what unbalance and runout follow and the speed channel reports."""

import math

import numpy as np

from core.arrays import FloatArray

PARTS = ((0.5, 1.0), (0.3, 0.57), (0.2, 0.31))
"""Share of the whole wander and period in wander times, of the swings that make it up."""


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
