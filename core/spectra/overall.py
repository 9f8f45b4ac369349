"""Broad-band vibration of a segment, and vibration of its newest parts.

Broad-band displacement of shafts and velocity of bearings are what standards of the ISO 20816
family judge. Limits of fast changes are judged by the newest parts: averages over minutes show a
step minutes later, parts of a segment show it within seconds, and for how long it has lasted.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Measurand, displacement_factor
from core.machine.unit import Unit
from core.quality import Reading
from core.spectra.cross_spectrum import NOISE_BANDWIDTH_BINS
from core.spectra.lines import SegmentSettings
from core.units import hz_from_rpm

MAX_PARTS = 4
"""Of what a segment adds to the one before; 3 s each at the defaults."""

PART_TURNS = 4.0
"""Turns in a part, at least: the main lobe of Hann's taper then reaches half an order from 1×
(Harris 1978), short of the vortex at 0.2 to 0.4 orders."""

MM_FROM_UM = 1e-3

DISPLACEMENTS = (Measurand.GAP_UM, Measurand.DISPLACEMENT_UM)


@dataclass(frozen=True)
class Overall:
    """Broad-band vibration of one segment.

    Parameters
    ----------
    peak_to_peak_um : (n_channels,)
        Of the samples as they are; NaN where a channel measures no displacement.
    orbit_um_pk : (n_bearings,)
        Farthest that each shaft went from its mean place, as ISO 20816-1, annex B, S_max; NaN
        where not both directions are displacements.
    velocity_mm_s_rms : (n_channels,)
        Over the band, free of the transducer's response; zero for a key-phase.
    """

    peak_to_peak_um: FloatArray
    orbit_um_pk: FloatArray
    velocity_mm_s_rms: FloatArray


class OverallTransform:
    """Reads broad-band vibration off segments of one unit.

    Parameters
    ----------
    settings
        The band is that of its `velocity_low_order` of the rated speed to `velocity_high_hz`, as
        far as the sampling rate reaches.
    """

    def __init__(self, unit: Unit, settings: SegmentSettings) -> None:
        ids = [channel.id for channel in unit.channels]
        self._is_displacement = np.array([c.measurand in DISPLACEMENTS for c in unit.channels])
        self._shafts = [[ids.index(b.shaft_x), ids.index(b.shaft_y)] for b in unit.bearings]
        bin_hz = unit.rate_hz / settings.segment_samples
        frequency_hz: FloatArray = bin_hz * np.arange(
            1, settings.segment_samples // 2, dtype=np.float64
        )
        low_hz = settings.velocity_low_order * hz_from_rpm(unit.rated_speed_rpm)
        in_band = (frequency_hz >= low_hz) & (frequency_hz <= settings.velocity_high_hz)
        band: npt.NDArray[np.intp] = np.flatnonzero(in_band)
        self._band = slice(int(band[0]), int(band[-1]) + 1) if band.size else slice(0)
        band_hz: FloatArray = frequency_hz[self._band]
        mm_s = 2.0 * np.pi * band_hz * MM_FROM_UM
        factor = [(mm_s * np.abs(displacement_factor(c, band_hz))) ** 2 for c in unit.channels]
        # of real and imaginary parts in turn
        self._power_factor = np.repeat(factor, 2, axis=1)

    def of(self, samples: FloatArray, centred: FloatArray, phasors: ComplexArray) -> Overall:
        """Broad-band vibration of a segment.

        Parameters
        ----------
        samples : (n_channels, n_samples)
            As measured, finite.
        centred : (n_channels, n_samples)
            The same without the mean of each channel.
        phasors : (n_channels, n_lines)
            At all bins above zero, in the channels' own units.
        """
        span = np.where(self._is_displacement, np.ptp(samples, axis=1), np.nan)
        parts = phasors[:, self._band].view(np.float64)
        power = np.einsum("ij,ij->i", parts * parts, self._power_factor)
        power /= 2.0 * NOISE_BANDWIDTH_BINS
        return Overall(span, self._orbits(centred), np.sqrt(power))

    def _orbits(self, centred: FloatArray) -> FloatArray:
        return np.array([self._orbit(centred, rows) for rows in self._shafts])

    def _orbit(self, centred: FloatArray, rows: Sequence[int]) -> float:
        if not self._is_displacement[rows].all():
            return float("nan")
        x, y = centred[rows]
        return math.sqrt(float((x * x + y * y).max()))


@dataclass(frozen=True)
class RecentVibration:
    """The newest parts of one segment, oldest first.

    Parameters
    ----------
    stop : (n_parts,)
        Sample behind each part, counted from the segment's first.
    order1_um_pk : (n_parts, n_channels)
        Displacement amplitudes at 1×, without runout where that can be taken off.
    peak_to_peak_um : (n_parts, n_channels)
        Of the samples as they are; only of channels that measure displacement.
    """

    stop: npt.NDArray[np.int64]
    order1_um_pk: FloatArray
    peak_to_peak_um: FloatArray


@dataclass(frozen=True)
class RecentReadings:
    """Some quantities of one bearing, of the samples just before a moment alone."""

    time_ns: int
    readings: Mapping[str, Reading]


def parts_of(
    n_samples: int, hop_samples: int, turn_samples: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """First sample of each part of a segment, and the one behind it.

    They cover what the segment adds to the one before; a part is as long as its turns need, so
    that it may begin earlier.

    Parameters
    ----------
    hop_samples
        Samples from one segment's start to the next one's.
    turn_samples
        Samples in a turn of the shaft.
    """
    n_parts = int(np.clip(hop_samples / (PART_TURNS * turn_samples), 1, MAX_PARTS))
    stop = n_samples - hop_samples + hop_samples * np.arange(1, n_parts + 1) // n_parts
    length = max(hop_samples // n_parts, round(PART_TURNS * turn_samples))
    return np.maximum(stop - length, 0), stop
