"""Forces on the rotor, as endless streams: however a stream is cut, its samples are the same."""

import math
from typing import Protocol

import numpy as np

from acquisition.simulated.plant.rotation import Turning
from core.arrays import FloatArray

CUTOFF_FILTER_ORDER = 4
IMPULSE_SAMPLES_PER_CUTOFF_PERIOD = 20


class Excitation(Protocol):
    """A radial force on the rotor."""

    def advance(self, n_samples: int) -> FloatArray:
        """Give the next forces (x, y) in newtons, (2, n_samples)."""
        ...


class UnbalanceForce:
    """Force that turns forward with the shaft and grows with the square of its speed.

    Parameters
    ----------
    force_n
        At the mean speed.
    """

    def __init__(self, force_n: float, rotation: Turning) -> None:
        self._force_n = force_n
        self._rotation = rotation
        self._index = 0

    def advance(self, n_samples: int) -> FloatArray:
        """Give the next forces (x, y) in newtons, (2, n_samples)."""
        index = np.arange(self._index, self._index + n_samples, dtype=np.float64)
        self._index += n_samples
        angle = 2.0 * math.pi * np.fmod(self._rotation.turns(index), 1.0)
        return _rotating(self._force_n, angle) * self._rotation.relative_speed(index) ** 2


class RopeForce:
    """Force that turns forward at a frequency of its own while its phase wanders.

    The phase is a random walk, which spreads the line into a Lorentzian of the given width at half
    power (phase noise of a free oscillator: variance 2π · width · time).
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
        """Give the next forces (x, y) in newtons, (2, n_samples)."""
        steps = self._mean_step + self._step_rms * self._random.standard_normal(n_samples)
        angle = np.cumsum(np.concatenate([[self._angle], steps]))
        self._angle = float(angle[-1]) % (2.0 * math.pi)
        return _rotating(self._force_n, angle[:-1])


class HydraulicForce:
    """Gaussian force, independent in x and y, white or limited to a band."""

    def __init__(
        self, random: np.random.Generator, rms_n: float, cutoff_hz: float | None, rate_hz: float
    ) -> None:
        self._random = random
        self._sections = None if cutoff_hz is None else _low_pass(cutoff_hz, rate_hz)
        self._rms_n = rms_n
        self._filter_state = np.zeros((CUTOFF_FILTER_ORDER // 2, 2, 2))

    def advance(self, n_samples: int) -> FloatArray:
        """Give the next forces (x, y) in newtons, (2, n_samples)."""
        import scipy.signal  # slow to load, and not needed to begin

        force_n = self._rms_n * self._random.standard_normal((n_samples, 2)).T
        if self._sections is not None:
            force_n, self._filter_state = scipy.signal.sosfilt(
                self._sections, force_n, axis=1, zi=self._filter_state
            )
        return force_n


def _rotating(force_n: float, angle_rad: FloatArray) -> FloatArray:
    return force_n * np.stack([np.cos(angle_rad), np.sin(angle_rad)])


def _low_pass(cutoff_hz: float, rate_hz: float) -> FloatArray:
    """Second-order sections that keep the rms value of white noise."""
    import scipy.signal  # slow to load, and not needed to begin

    sections: FloatArray = scipy.signal.butter(
        CUTOFF_FILTER_ORDER, cutoff_hz, fs=rate_hz, output="sos"
    )
    impulse = np.zeros(math.ceil(IMPULSE_SAMPLES_PER_CUTOFF_PERIOD * rate_hz / cutoff_hz))
    impulse[0] = 1.0
    response = scipy.signal.sosfilt(sections, impulse)
    sections[0, :3] /= math.sqrt(float(np.sum(response**2)))
    return sections
