"""Frequency response of a transducer and its amplifier, relative to its sensitivity."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from core.arrays import ComplexArray, FloatArray

BUTTERWORTH_DAMPING = 1.0 / math.sqrt(2.0)


@dataclass(frozen=True)
class HighPass:
    """Lower frequency limit of an accelerometer, a charge amplifier or a velocity pickup.

    Parameters
    ----------
    corner_hz
        Of order 1 the frequency of 0.707 and +45°; of order 2 the natural frequency, at which the
        phase is +90° and the magnitude 1 / (2 damping).
    order
        1 for an electrical time constant; 2 for a pickup's seismic mass or a double time constant.
    damping
        Share of critical damping; counts for order 2 alone.
    """

    corner_hz: float
    order: int = 1
    damping: float = BUTTERWORTH_DAMPING

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Complex factor at frequencies above zero, (n_lines,)."""
        ratio = frequency_hz / self.corner_hz
        if self.order == 1:
            return np.asarray(1j * ratio / (1.0 + 1j * ratio))
        return np.asarray(-(ratio**2) / (1.0 - ratio**2 + 2j * self.damping * ratio))


@dataclass(frozen=True)
class Resonance:
    """Mounted resonance, or any second-order upper limit."""

    natural_hz: float
    damping: float

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Complex factor at frequencies above zero, (n_lines,)."""
        ratio = frequency_hz / self.natural_hz
        return np.asarray(1.0 / (1.0 - ratio**2 + 2j * self.damping * ratio))


@dataclass(frozen=True)
class ResponseTable:
    """Response from a calibration sheet.

    Between its points, the logarithm of the magnitude and the phase run smoothly over the logarithm
    of frequency and never beyond their neighbours (Fritsch and Butland, 1984): ten points a decade
    give a first-order corner to 2e-4, where straight lines would be 3e-3 off. A phase that jumps by
    more than half a turn is taken the short way round. Outside the table its end values hold.

    Parameters
    ----------
    frequency_hz
        Rising, above zero; two points or more.
    magnitude
        Above zero; 1 where the nominal sensitivity is exact.
    phase_deg
        Positive where the reading leads the motion.
    """

    frequency_hz: tuple[float, ...]
    magnitude: tuple[float, ...]
    phase_deg: tuple[float, ...]

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Complex factor at frequencies above zero, (n_lines,)."""
        from scipy.interpolate import PchipInterpolator  # slow to load, and not needed to begin

        points = np.log(self.frequency_hz)
        phase_rad = np.unwrap(np.radians(self.phase_deg))
        values = np.stack([np.log(self.magnitude), phase_rad])
        place = np.log(frequency_hz).clip(points[0], points[-1])
        log_magnitude, phase_rad = PchipInterpolator(points, values, axis=1)(place)
        return np.asarray(np.exp(log_magnitude + 1j * phase_rad))

    def covers(self, low_hz: float, high_hz: float) -> bool:
        """Whether the whole band lies within the table."""
        return self.frequency_hz[0] <= low_hz and high_hz <= self.frequency_hz[-1]


@dataclass(frozen=True)
class ResponseChain:
    """Several responses one after the other, as transducer and amplifier are; none is flat."""

    parts: tuple["Response", ...]

    def at(self, frequency_hz: FloatArray) -> ComplexArray:
        """Complex factor at frequencies above zero, (n_lines,)."""
        factor = np.ones(np.shape(frequency_hz), dtype=np.complex128)
        for part in self.parts:
            factor *= part.at(frequency_hz)
        return factor


Response: TypeAlias = HighPass | Resonance | ResponseTable | ResponseChain
"""Any of the above: complex reading per unit of motion at given frequencies."""
