"""Spectral lines: Fourier transforms of one segment at its bins and at exact frequencies.

Amplitudes are zero-to-peak; the taper is Hann's, periodic, as in the paper (Brito et al., 3.1).
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.checks.sensor_checks import SensorLimits


@dataclass(frozen=True)
class SegmentSettings:
    """Settings of segments and of their evaluation; defaults after Brito et al., 3.1.

    Parameters
    ----------
    segment_samples
        Samples of one Hann-tapered segment.
    overlap
        Overlap of consecutive segments as a fraction of a segment.
    n_segments
        Number of segments in the averaging window; 24 at 600 Hz are about five minutes.
    min_segments
        Number of segments below which a result is marked uncertain.
    min_coverage
        Fraction of the possible segments below which a result is marked uncertain.
    min_coherence
        Smallest squared coherence of shaft and bearing motion for a stiffness. At 0.9, equation (5)
        is 5 % too high if the incoherent part is noise of the bearing channel.
    max_frequency_hz
        Highest frequency of the spectra.
    vortex_order
        Nominal frequency of the part-load vortex in multiples of the running speed.
    vortex_band
        Lowest and highest frequency of the vortex peak in multiples of the running speed.
    min_line_to_floor
        Smallest ratio of a significant line's power to the median power of the bins around it.
    min_speed_fraction
        Fraction of the rated speed below which the machine is at standstill.
    velocity_low_order, velocity_high_hz
        Band of a bearing's broad-band velocity: from this multiple of the rated speed (0.25
        includes the vortex) to this frequency.
    sensors
        Limits for the detection of failed transducers and unsteady operation.
    """

    segment_samples: int = 8192
    overlap: float = 0.125
    n_segments: int = 24
    min_segments: int = 4
    min_coverage: float = 0.5
    min_coherence: float = 0.9
    max_frequency_hz: float = 25.0
    vortex_order: float = 0.25
    vortex_band: tuple[float, float] = (0.2, 0.4)
    min_line_to_floor: float = 10.0
    min_speed_fraction: float = 0.2
    velocity_low_order: float = 0.25
    velocity_high_hz: float = 1000.0
    sensors: SensorLimits = field(default_factory=SensorLimits)

    @property
    def hop_samples(self) -> int:
        """Number of samples from the start of one segment to the start of the next."""
        return self.segment_samples - round(self.segment_samples * self.overlap)


FINE_STEPS = 64
"""Length of a run of samples in `turning_factors`."""


@lru_cache(maxsize=8)
def hann(n_samples: int) -> FloatArray:
    """Return the periodic Hann taper, (n_samples,), read-only."""
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n_samples) / n_samples)
    taper.setflags(write=False)
    return taper


@lru_cache(maxsize=8)
def taper_weights(n_samples: int) -> FloatArray:
    """Return the Hann taper, (n_samples,), scaled for zero-to-peak phasors, read-only."""
    weights: FloatArray = 2.0 * hann(n_samples) / hann(n_samples).sum()
    weights.setflags(write=False)
    return weights


def bin_phasors(tapered_samples: FloatArray, n_lines: int) -> ComplexArray:
    """Return the phasors (n_channels, n_lines) at the first Fourier bins above zero.

    `tapered_samples` (n_channels, n_samples) must already be multiplied by `taper_weights`, which
    make the magnitudes zero-to-peak amplitudes. Line 0 is bin 1.
    """
    return np.asarray(np.fft.rfft(tapered_samples, axis=1)[:, 1 : n_lines + 1])


def turning_factors(n_samples: int, rate_hz: float, frequency_hz: FloatArray) -> ComplexArray:
    """Return the factors ``exp(-iωt)`` of Fourier sums at the frequencies, (n_samples, n_lines).

    Each factor is computed as the product of the factor at the start of its run of `FINE_STEPS`
    samples and the factor within the run.
    """
    turn_rad = -2j * np.pi * frequency_hz / rate_hz
    n_coarse = -(-n_samples // FINE_STEPS)
    fine = np.exp(np.outer(np.arange(FINE_STEPS), turn_rad))
    coarse = np.exp(np.outer(FINE_STEPS * np.arange(n_coarse), turn_rad))
    factors = np.empty((n_coarse, FINE_STEPS, turn_rad.size), dtype=np.complex128)
    for line in range(turn_rad.size):  # an inner loop over the few lines would be slow
        np.multiply(coarse[:, line, np.newaxis], fine[:, line], out=factors[..., line])
    return factors.reshape(-1, turn_rad.size)[:n_samples]


def line_phasors(tapered_samples: FloatArray, factors: ComplexArray) -> ComplexArray:
    """Return the phasors (n_channels, n_lines) at the frequencies given to `turning_factors`.

    `tapered_samples` (n_channels, n_samples) are multiplied by `taper_weights`.
    """
    parts: FloatArray = tapered_samples @ factors.view(np.float64)
    return parts.view(np.complex128)


def part_phasors(samples: FloatArray, factors: ComplexArray) -> ComplexArray:
    """Return the phasors (n_channels, n_lines) of samples with mean and without taper.

    The samples are not copied: the taper is applied to the factors from `turning_factors`, and the
    contribution of each channel's mean is subtracted.
    """
    weighted = factors * taper_weights(samples.shape[1])[:, np.newaxis]
    of_mean = samples.mean(axis=1, keepdims=True) * weighted.sum(axis=0)
    return np.asarray(line_phasors(samples, weighted) - of_mean)


def peak_frequency_hz(
    power: FloatArray, frequency_hz: FloatArray, band_hz: tuple[float, float]
) -> float | None:
    """Return the frequency of the strongest line in a band, interpolated between the bins.

    The bins k and k + 1 next to a tone at ``k + d`` in a Hann spectrum have the amplitude ratio
    ``a = (1 + d) / (2 - d)``, so ``d = (2a - 1) / (a + 1)`` (Grandke 1983, eq. 10).

    Parameters
    ----------
    power, frequency_hz : (n_lines,)
        Powers and evenly spaced frequencies of the bins.
    band_hz
        Lowest and highest frequency of the band.

    Returns
    -------
    Frequency in Hz; None if the band contains no bins, or if its strongest bin is the flank of a
    line outside the band.
    """
    inside = np.flatnonzero((frequency_hz >= band_hz[0]) & (frequency_hz <= band_hz[1]))
    inside = inside[(inside > 0) & (inside < power.size - 1)]
    if inside.size == 0:
        return None
    top = int(inside[np.argmax(power[inside])])
    if power[top] < max(power[top - 1], power[top + 1]):
        return None
    left = top - 1 if power[top - 1] >= power[top + 1] else top
    if power[left] <= 0.0 or power[left + 1] <= 0.0:
        return float(frequency_hz[top])
    ratio = float(np.sqrt(power[left + 1] / power[left]))
    offset = np.clip((2.0 * ratio - 1.0) / (ratio + 1.0), 0.0, 1.0)
    found = float(frequency_hz[left] + offset * (frequency_hz[1] - frequency_hz[0]))
    return found if band_hz[0] <= found <= band_hz[1] else None
