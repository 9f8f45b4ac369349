"""Broad-band vibration: displacement of shafts peak-to-peak, velocity of bearings rms.

What standards of the ISO 20816 family judge; nothing else in padwatch is made of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.machine.transducers import displacement_factor
from core.machine.unit import Measurand, Unit
from core.spectra.cross_spectrum import NOISE_BANDWIDTH_BINS
from core.spectra.lines import SegmentSettings
from core.units import hz_from_rpm

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
        self._band: npt.NDArray[np.intp] = np.flatnonzero(in_band)
        band_hz: FloatArray = frequency_hz[self._band]
        self._mm_s = np.array(
            [
                2.0 * np.pi * band_hz * MM_FROM_UM * np.abs(displacement_factor(channel, band_hz))
                for channel in unit.channels
            ]
        )

    def of(self, samples: FloatArray, phasors: ComplexArray) -> Overall:
        """Broad-band vibration of a segment.

        Parameters
        ----------
        samples : (n_channels, n_samples)
            As measured, finite.
        phasors : (n_channels, n_lines)
            At all bins above zero, in the channels' own units.
        """
        span = np.where(self._is_displacement, np.ptp(samples, axis=1), np.nan)
        speed = self._mm_s * np.abs(phasors[:, self._band])
        power = (speed**2).sum(axis=1) / (2.0 * NOISE_BANDWIDTH_BINS)
        return Overall(span, self._orbits(samples), np.sqrt(power))

    def _orbits(self, samples: FloatArray) -> FloatArray:
        return np.array([self._orbit(samples, rows) for rows in self._shafts])

    def _orbit(self, samples: FloatArray, rows: Sequence[int]) -> float:
        if not self._is_displacement[rows].all():
            return float("nan")
        moved = samples[rows] - samples[rows].mean(axis=1, keepdims=True)
        return float(np.hypot(moved[0], moved[1]).max())
