"""Amplitudes of spectral lines as Welch and scipy have them, and averages over segments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs.tapered import tapered
from scipy import signal

from core.arrays import FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings
from core.quality import GOOD, Reading
from core.samples.ring import Window
from core.spectra.cross_spectrum import CrossSpectrum, average
from core.spectra.lines import bin_phasors, hann, part_phasors, peak_frequency_hz, turning_factors
from core.spectra.segments import SegmentTransform

RATE_HZ = 600.0


def test_the_taper_is_the_one_of_scipy_and_phasors_on_a_bin_are_the_transform_there():
    np.testing.assert_allclose(hann(8192), signal.get_window("hann", 8192), atol=1e-15)
    samples = np.random.default_rng(2).normal(size=(2, 1024))
    frequency_hz = np.array([3, 10, 77]) * RATE_HZ / 1024
    exact = part_phasors(samples, turning_factors(1024, RATE_HZ, frequency_hz))
    bins = bin_phasors(tapered(samples), 100)
    np.testing.assert_allclose(exact, bins[:, [2, 9, 76]], atol=1e-12)


@given(
    frequency_hz=st.floats(0.3, 3.0),
    phase_rad=st.floats(0.0, 2 * np.pi),
    gap_um=st.floats(-3000.0, 3000.0),
)
def test_a_minute_of_a_tone_of_any_frequency_reads_its_amplitude(frequency_hz, phase_rad, gap_um):
    """Required: 0.3 % for 0.3 to 3 Hz from 60 s."""
    time_s = np.arange(int(60 * RATE_HZ)) / RATE_HZ
    tone = gap_um + 60.0 * np.cos(2 * np.pi * frequency_hz * time_s + phase_rad)
    turning = turning_factors(8192, RATE_HZ, np.array([frequency_hz]))
    segments = [
        part_phasors(tone[np.newaxis, start : start + 8192], turning)
        for start in range(0, tone.size - 8191, 7168)
    ]
    spectrum = average(
        np.array([frequency_hz]), np.array(segments), np.ones((len(segments), 1), bool)
    )
    assert spectrum.amplitude_um_pk(0)[0] == pytest.approx(60.0, rel=3e-3)


@pytest.mark.parametrize("speed_rpm", [60.0, 90.9, 92.3, 111.7, 150.0])
def test_1x_reads_true_at_any_running_speed(speed_rpm, results, signals):
    newest = results(signals(60.0, 0.0, speed_rpm), speed_rpm=speed_rpm)[-1].readings
    assert newest["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=3e-3)
    assert newest["order1_k_eff_xx_n_per_m"].value == pytest.approx(1.18e9 / 3, rel=3e-3)


@given(st.floats(4.6, 60.4), st.floats(0.0, 2 * np.pi))
def test_a_tone_is_located_between_the_bins(bins, phase_rad):
    number = np.arange(2048)
    tone = np.cos(2 * np.pi * bins * number / 2048 + phase_rad)
    power = np.abs(bin_phasors(tapered(tone[np.newaxis]), 100)[0]) ** 2
    frequency_hz = np.arange(1, 101) * 1.0
    found = peak_frequency_hz(power, frequency_hz, (3.0, 70.0))
    assert found == pytest.approx(bins, abs=0.01)


def test_a_peak_is_no_flank():
    frequency_hz = np.arange(1.0, 21.0)
    power = 1.0 / frequency_hz**2
    assert peak_frequency_hz(power, frequency_hz, (5.0, 10.0)) is None
    assert peak_frequency_hz(power, frequency_hz, (30.0, 40.0)) is None


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


def test_samples_in_single_precision_cost_no_more_than_their_own_rounding(samples):
    channels = tuple(Channel(i, Measurand.DISPLACEMENT_UM) for i in ("sx", "sy", "bx", "by"))
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0))
    unit = Unit("U1", 92.3, RATE_HZ, channels, (bearing,), "speed")
    transform = SegmentTransform(unit, SETTINGS)
    travelling = samples.astype(np.float32)
    for start in range(0, N_SAMPLES - 8191, SETTINGS.hop_samples):
        piece = travelling[:, start : start + 8192]
        slow = {"speed": Reading(92.3)}
        transform.add(Window(1, start, 0, RATE_HZ, piece, (GOOD,) * 4, slow))

    segments = list(transform.segments)
    ours = average(
        transform.frequency_hz,
        np.array([segment.bin_phasors_um_pk for segment in segments]),
        np.array([segment.usable for segment in segments]),
    )

    assert len(segments) == 24
    assert_same(ours, samples, 1e-5)


FREQUENCY_HZ = np.array([1.0, 2.0])


@pytest.fixture
def phasors() -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.normal(size=(9, 4, 2)) + 1j * rng.normal(size=(9, 4, 2))


def test_the_matrix_is_hermitian_and_its_diagonal_is_the_power(phasors):
    spectrum = average(FREQUENCY_HZ, phasors, np.ones((9, 4), dtype=bool))
    np.testing.assert_allclose(spectrum.matrix, spectrum.matrix.conj().transpose(0, 2, 1))
    np.testing.assert_allclose(
        np.diagonal(spectrum.matrix, axis1=1, axis2=2),
        np.diagonal(spectrum.power, axis1=1, axis2=2),
    )
    np.testing.assert_allclose(
        spectrum.matrix[1, 0, 2], np.mean(phasors[:, 0, 1] * phasors[:, 2, 1].conj())
    )


def test_a_failed_channel_takes_nothing_from_the_others(phasors):
    usable = np.ones((9, 4), dtype=bool)
    usable[3:, 2] = False
    spoiled = phasors.copy()
    spoiled[3:, 2] = 1e9
    spectrum = average(FREQUENCY_HZ, spoiled, usable)
    whole = average(FREQUENCY_HZ, phasors, np.ones((9, 4), dtype=bool))
    np.testing.assert_allclose(spectrum.power[:, 0, 1], whole.power[:, 0, 1])
    own = np.mean(np.abs(phasors[:3, 2]) ** 2, axis=0)
    np.testing.assert_allclose(spectrum.amplitude_um_pk(2), np.sqrt(own))
    assert spectrum.n_segments[0, 1] == 9
    assert spectrum.n_segments[0, 2] == 3


def test_amplitudes_that_are_compared_come_from_the_same_segments():
    """A machine whose motion grows tenfold after the accelerometer fails keeps its ratio."""
    phasors = np.ones((4, 2, 1), dtype=complex)
    phasors[:, 0] = 2.0
    phasors[2:, 0] = 20.0
    usable = np.array([[True, True], [True, True], [True, False], [True, False]])
    spectrum = average(np.array([1.0]), phasors, usable)
    assert spectrum.amplitude_ratio(1, 0)[0] == pytest.approx(0.5)
    assert spectrum.amplitude_um_pk(0)[0] == pytest.approx(np.sqrt((4 + 4 + 400 + 400) / 4))


def test_coherence_is_one_for_a_common_cause_small_for_none_and_zero_for_nothing(phasors):
    usable = np.ones((9, 4), dtype=bool)
    common = phasors.copy()
    common[:, 1] = (0.3 + 0.4j) * common[:, 0]
    spectrum = average(FREQUENCY_HZ, common, usable)
    np.testing.assert_allclose(spectrum.coherence(0, 1), 1.0)
    assert np.all(spectrum.coherence(0, 2) < 0.6)
    spectrum = average(FREQUENCY_HZ, phasors, np.zeros((9, 4), dtype=bool))
    assert not spectrum.n_segments.any()
    assert not spectrum.coherence(0, 2).any()
    assert not spectrum.amplitude_ratio(2, 0).any()


def test_a_path_is_the_two_circles_it_is_made_of():
    time_s = np.arange(1024) / RATE_HZ
    turn = 2.0 * np.pi * 40 * RATE_HZ / 1024 * time_s
    path = 7.0 * np.exp(1j * turn) + 3.0 * np.exp(-1j * (turn + 0.4))  # from x to y, and back
    phasors = bin_phasors(tapered(np.stack([path.real, path.imag])), 100)
    spectrum = average(np.arange(1, 101.0), phasors[np.newaxis], np.ones((1, 2), np.bool_))
    forward, backward = spectrum.rotating_um_pk(0, 1)
    assert (forward[39], backward[39]) == pytest.approx((7.0, 3.0))
    assert max(forward[60:].max(), backward[60:].max()) < 1e-9
