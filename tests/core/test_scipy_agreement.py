"""The fast path, segment by segment, is plain scipy over the whole window."""

import numpy as np
import pytest
from scipy import signal

from core.arrays import FloatArray
from core.blocks import SampleBlock
from core.cross_spectrum import CrossSpectrum, average
from core.machine import Bearing, Channel, Measurand, Unit
from core.quality import GOOD, Reading
from core.segments import SegmentTransform
from core.settings import AnalysisSettings

RATE_HZ = 600.0
SETTINGS = AnalysisSettings()
N_SAMPLES = 8192 + 23 * 7168  # 24 segments, 5 minutes


@pytest.fixture(scope="module")
def samples() -> FloatArray:
    """Shaft and bearing with common motion, a 1× line and gaps of 2000 µm."""
    rng = np.random.default_rng(4)
    noise = signal.lfilter([1.0], [1.0, -0.95], rng.normal(size=(4, N_SAMPLES)), axis=1)
    noise[2:] = 0.4 * noise[:2] + 0.1 * noise[2:]
    noise += 20.0 * np.cos(2.0 * np.pi * 1.538 * np.arange(N_SAMPLES) / RATE_HZ)
    noise[:2] += 2000.0
    return noise


def scipys(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrix (n_lines, 4, 4) of squared zero-to-peak phasors, by `scipy.signal.csd` and `welch`."""
    how = {"fs": RATE_HZ, "nperseg": 8192, "noverlap": 1024, "scaling": "spectrum"}
    # scipy conjugates the first, and its power is mean square where padwatch has peak squared
    matrix = 2.0 * np.array(
        [[signal.csd(b, a, window="hann", **how)[1] for b in samples] for a in samples]
    )
    power = 2.0 * np.array([signal.welch(a, window="hann", **how)[1] for a in samples])
    n_lines = int(SETTINGS.max_frequency_hz * 8192 / RATE_HZ)
    return matrix.transpose(2, 0, 1)[1 : n_lines + 1], power[:, 1 : n_lines + 1].T


def assert_same(ours: CrossSpectrum, samples: FloatArray, tolerance: float) -> None:
    """Compare relative to the power of the two channels: a cross-spectrum may be nearly zero."""
    matrix, power = scipys(samples)
    scale = np.sqrt(power[:, :, np.newaxis] * power[:, np.newaxis, :])
    assert np.max(np.abs(ours.matrix - matrix) / scale) < tolerance
    own = np.diagonal(ours.power, axis1=1, axis2=2)
    np.testing.assert_allclose(own, power, rtol=tolerance)


def test_samples_in_single_precision_cost_no_more_than_their_own_rounding(
    samples: FloatArray,
) -> None:
    channels = tuple(Channel(i, Measurand.DISPLACEMENT_UM) for i in ("sx", "sy", "bx", "by"))
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0))
    unit = Unit("U1", 92.3, RATE_HZ, channels, (bearing,), "speed")
    transform = SegmentTransform(unit, SETTINGS)
    travelling = samples.astype(np.float32)
    for start in range(0, N_SAMPLES - 8191, SETTINGS.hop_samples):
        piece = travelling[:, start : start + 8192]
        slow = {"speed": Reading(92.3)}
        transform.add(SampleBlock("U1", 1, start, 0, RATE_HZ, piece, (GOOD,) * 4, slow))

    segments = list(transform.segments)
    ours = average(
        transform.frequency_hz,
        np.array([segment.bin_phasors_um_pk for segment in segments]),
        np.array([segment.usable for segment in segments]),
    )

    assert len(segments) == 24
    assert_same(ours, samples, 1e-5)
