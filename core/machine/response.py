"""Frequency response of a transducer and its amplifier, relative to its sensitivity."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from core.arrays import ComplexArray, FloatArray

BUTTERWORTH_DAMPING = 1.0 / math.sqrt(2.0)


@dataclass(frozen=True)
class HighPass:
    """High-pass response of an accelerometer, a charge amplifier or a velocity pickup.

    Parameters
    ----------
    corner_hz
        For order 1, the frequency with magnitude 0.707 and phase +45°; for order 2, the natural
        frequency, with phase +90° and magnitude 1 / (2 damping).
    order
        1 for an electrical time constant; 2 for a pickup's seismic mass or a double time constant.
    damping
        Fraction of critical damping; used for order 2 only.
    """

    corner_hz: float
    order: int = 1
    damping: float = BUTTERWORTH_DAMPING

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the complex response at positive frequencies in Hz, (n_lines,)."""
        ratio = frequency_hz / self.corner_hz
        if self.order == 1:
            return np.asarray(1j * ratio / (1.0 + 1j * ratio))
        return np.asarray(-(ratio**2) / (1.0 - ratio**2 + 2j * self.damping * ratio))


@dataclass(frozen=True)
class Resonance:
    """Second-order low-pass response, such as a resonance; `damping` is a fraction of critical."""

    natural_hz: float
    damping: float

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the complex response at positive frequencies in Hz, (n_lines,)."""
        ratio = frequency_hz / self.natural_hz
        return np.asarray(1.0 / (1.0 - ratio**2 + 2j * self.damping * ratio))


@dataclass(frozen=True)
class ResponseTable:
    """Tabulated response from a calibration sheet.

    The logarithm of the magnitude and the phase are interpolated over the logarithm of frequency by
    monotone cubics (Fritsch and Butland, 1984). Ten points a decade reproduce a first-order corner
    to 2e-4; linear interpolation would err by 3e-3. The phase is unwrapped: jumps of more than half
    a turn are taken the short way round. Outside the table, its end values apply.

    Parameters
    ----------
    frequency_hz
        Frequencies, positive and ascending; at least two.
    magnitude
        Positive magnitudes; 1 means exactly the nominal sensitivity.
    phase_deg
        Phases; positive if the reading leads the motion.
    """

    frequency_hz: tuple[float, ...]
    magnitude: tuple[float, ...]
    phase_deg: tuple[float, ...]

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the complex response at positive frequencies in Hz, (n_lines,)."""
        from scipy.interpolate import PchipInterpolator  # slow import, not needed at start

        points = np.log(self.frequency_hz)
        phase_rad = np.unwrap(np.radians(self.phase_deg))
        values = np.stack([np.log(self.magnitude), phase_rad])
        place = np.log(frequency_hz).clip(points[0], points[-1])
        log_magnitude, phase_rad = PchipInterpolator(points, values, axis=1)(place)
        return np.asarray(np.exp(log_magnitude + 1j * phase_rad))


@dataclass(frozen=True)
class ResponseChain:
    """Product of responses in series, such as transducer and amplifier; 1 for an empty chain."""

    parts: tuple["Response", ...]

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the complex response at positive frequencies in Hz, (n_lines,)."""
        factor = np.ones(np.shape(frequency_hz), dtype=np.complex128)
        for part in self.parts:
            factor *= part.at(frequency_hz)
        return factor


Response: TypeAlias = HighPass | Resonance | ResponseTable | ResponseChain
"""Any frequency response; `at` returns the ratio of the reading to the true motion, complex."""
