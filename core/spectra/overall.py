"""Broad-band vibration of a segment, and vibration of the parts of its last seconds.

The standards of the ISO 20816 family evaluate broad-band displacement of shafts and velocity of
bearings. Limits for fast changes use the newest parts of a segment: they show a step and its
duration within seconds; averages over minutes would show it minutes later.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray, IntArray
from core.machine.channel import Measurand, displacement_factor
from core.machine.unit import Unit
from core.quality import Reading
from core.spectra.cross_spectrum import NOISE_BANDWIDTH_BINS
from core.spectra.lines import SegmentSettings
from core.spectra.resolution import shaft_matrix
from core.units import hz_from_rpm

MAX_PARTS = 4
"""Largest number of parts into which the last hop of a segment is divided; 3 s each by default."""

PART_TURNS = 4.0
"""Smallest number of turns in a part. The main lobe of Hann's taper then reaches half an order from
1× (Harris 1978), short of the vortex at 0.2 to 0.4 orders."""

MM_FROM_UM = 1e-3

DISPLACEMENTS = (Measurand.GAP_UM, Measurand.DISPLACEMENT_UM)


@dataclass(frozen=True)
class Overall:
    """Broad-band vibration of one segment.

    Parameters
    ----------
    peak_to_peak_um : (n_channels,)
        Range of the raw samples, along the transducer; NaN for channels that measure no
        displacement.
    orbit_um_pk : (n_bearings,)
        Largest displacement of each shaft from its mean position, S_max of ISO 20816-1, annex B;
        NaN unless displacement is measured in both directions.
    velocity_mm_s_rms : (n_channels,)
        Velocity in the band of `SegmentSettings`, with the transducer's response compensated; zero
        for a key-phase channel.
    shafts
        Rows of the two shaft channels of each bearing.
    """

    peak_to_peak_um: FloatArray
    orbit_um_pk: FloatArray
    velocity_mm_s_rms: FloatArray
    shafts: Sequence[Sequence[int]]


class OverallTransform:
    """Computation of the broad-band vibration of a segment of one unit.

    The velocity band is from `settings.velocity_low_order` times the rated speed to
    `settings.velocity_high_hz`, at most half the sampling rate.
    """

    def __init__(self, unit: Unit, settings: SegmentSettings) -> None:
        ids = [channel.id for channel in unit.channels]
        self._is_displacement = np.array([c.measurand in DISPLACEMENTS for c in unit.channels])
        self._shafts = [[ids.index(b.shaft_x), ids.index(b.shaft_y)] for b in unit.bearings]
        self._matrices = [shaft_matrix(unit, bearing) for bearing in unit.bearings]
        self._directions = np.array([[channel.direction] for channel in unit.channels])
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
        # for alternating real and imaginary parts
        self._power_factor = np.repeat(factor, 2, axis=1)

    def of(self, samples: FloatArray, centred: FloatArray, phasors: ComplexArray) -> Overall:
        """Return the broad-band vibration of a segment.

        Parameters
        ----------
        samples : (n_channels, n_samples)
            Finite samples as measured.
        centred : (n_channels, n_samples)
            Samples without the mean of each channel.
        phasors : (n_channels, n_lines)
            Phasors at all bins above zero, in the channels' own units.
        """
        span = np.where(self._is_displacement, np.ptp(samples, axis=1), np.nan)
        parts = phasors[:, self._band].view(np.float64)
        power = np.einsum("ij,ij->i", parts * parts, self._power_factor)
        power /= 2.0 * NOISE_BANDWIDTH_BINS
        pairs = zip(self._shafts, self._matrices, strict=True)
        orbits = np.array([self._orbit(centred, rows, matrix) for rows, matrix in pairs])
        return Overall(span, orbits, np.sqrt(power), self._shafts)

    def _orbit(self, centred: FloatArray, rows: Sequence[int], matrix: FloatArray | None) -> float:
        if not self._is_displacement[rows].all():
            return float("nan")
        x, y = centred[rows]
        if matrix is not None:
            x, y = matrix @ (self._directions[rows] * centred[rows])
        return math.sqrt(float((x * x + y * y).max()))


@dataclass(frozen=True)
class RecentVibration:
    """Vibration of the newest parts of one segment, oldest first.

    Parameters
    ----------
    stop : (n_parts,)
        First sample after each part, relative to the segment's first sample.
    order1_um_pk : (n_parts, n_channels)
        Displacement amplitudes at 1×; runout is subtracted if possible.
    peak_to_peak_um : (n_parts, n_channels)
        Range of the raw samples; valid only for channels that measure displacement.
    """

    stop: IntArray
    order1_um_pk: FloatArray
    peak_to_peak_um: FloatArray


@dataclass(frozen=True)
class RecentReadings:
    """Readings of one bearing, by quantity, over a few seconds that end at `time_ns` (UTC)."""

    time_ns: int
    readings: Mapping[str, Reading]


def parts_of(n_samples: int, hop_samples: int, turn_samples: float) -> tuple[IntArray, IntArray]:
    """Return the first sample of each part of a segment and the first sample after it, (n_parts,).

    The parts cover the last `hop_samples` samples of the segment of `n_samples` samples. A part has
    at least `PART_TURNS` turns of `turn_samples` samples, and may therefore begin earlier.
    """
    n_parts = int(np.clip(hop_samples / (PART_TURNS * turn_samples), 1, MAX_PARTS))
    stop = n_samples - hop_samples + hop_samples * np.arange(1, n_parts + 1) // n_parts
    length = max(hop_samples // n_parts, round(PART_TURNS * turn_samples))
    return np.maximum(stop - length, 0), stop
