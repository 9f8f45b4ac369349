"""Lines away from harmonics, and what tapered segments say independently of each other."""

import numpy as np
import pytest
from rigs.tapered import tapered
from scipy import signal

from core.spectra.cross_spectrum import (
    BIN_CORRELATION,
    CORRELATED_LINES,
    SMEAR_BINS_SQUARED,
    SMEARED_IN_PHASE,
    SMEARED_IN_QUADRATURE,
    WHITE_PRODUCTS,
    correlated_sum,
    independent_segments,
    leakage_kernel,
    phasor_power_per_density,
)
from core.spectra.lines import bin_phasors
from core.stiffness.dynamic_lines import between_harmonics, little_leakage

FREQUENCY_HZ = 600.0 / 8192 * np.arange(1, 342)
BIN_HZ = float(FREQUENCY_HZ[0])


@pytest.mark.parametrize("speed_rpm", [60.0, 92.3, 150.0])
def test_no_used_line_is_within_the_guard_of_any_harmonic(speed_rpm):
    turn_hz = speed_rpm / 60.0
    used = between_harmonics(FREQUENCY_HZ, (turn_hz, turn_hz), 3.0)

    orders = turn_hz * np.arange(1, 30)
    nearest = np.abs(np.subtract.outer(FREQUENCY_HZ, orders)).min(axis=1)
    np.testing.assert_array_equal(used, nearest > 3.0 * BIN_HZ)


def test_the_guard_of_a_harmonic_follows_the_speed_and_a_senseless_one_is_refused():
    wandering = between_harmonics(FREQUENCY_HZ, (1.53, 1.55), 3.0)

    for speed_hz in np.linspace(1.53, 1.55, 41):
        steady = between_harmonics(FREQUENCY_HZ, (speed_hz, speed_hz), 3.0)
        assert not np.any(wandering & ~steady)

    used = between_harmonics(FREQUENCY_HZ, (1.0, 1.3), 3.0)
    assert not used[FREQUENCY_HZ > 4.0].any()
    assert used[FREQUENCY_HZ < 0.7].any()


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.5])
def test_side_lobes_stay_below_the_kernel_wherever_the_tone_falls(offset):
    time_s = np.arange(8192) / 600.0
    tone = np.cos(2.0 * np.pi * (100.0 + offset) * BIN_HZ * time_s + 0.7)
    power = np.abs(bin_phasors(tapered(tone[np.newaxis]), 341)[0]) ** 2

    leaked = leakage_kernel(341)[:, 98:102] @ power[98:102]

    far = np.abs(np.arange(341) - 99) > 4  # line 99 is bin 100
    far[:2] = False  # where the mean that was taken off shows: below any band that is used
    assert np.all(power[far] <= leaked[far])


def test_lines_beside_a_strong_tone_are_dropped_and_quiet_distant_ones_kept():
    power = np.ones((341, 1))
    power[100] = 1e4
    own = little_leakage(power).all(axis=1)

    assert not own[104:108].any()
    assert own[115:].all()
    assert own[:85].all()
    # Flat noise leaks too little to drop a line.
    assert little_leakage(np.ones((341, 2))).all()


def test_noise_of_known_density_has_the_power_and_the_correlation_stated():
    noise = np.random.default_rng(2).normal(size=(400, 8192))
    power = np.abs(bin_phasors(tapered(noise), 300)) ** 2

    # One-sided density of unit variance at 600 Hz; 120,000 correlated values, good to 0.4 %.
    assert power.mean() == pytest.approx(phasor_power_per_density(BIN_HZ) / 300.0, rel=0.015)

    noise = np.random.default_rng(3).normal(size=(400, 8192))
    phasors = bin_phasors(tapered(noise), 300)

    for distance, stated in enumerate(BIN_CORRELATION):
        product = phasors[:, : 300 - distance] * phasors[:, distance:].conj()
        found = abs(product.mean()) / (np.abs(phasors) ** 2).mean()
        assert found == pytest.approx(stated, abs=0.01)


def test_correlated_lines_and_overlapping_segments_count_for_less():
    def variance(lines: list[int], products: tuple[float, ...] = WHITE_PRODUCTS) -> float:
        terms, parts = np.ones((1, 1, 1, len(lines))), np.array(products)[:, np.newaxis]
        return float(correlated_sum(terms, np.array([lines]), parts)[0, 0, 0])

    assert variance(list(range(2000))) / 2000 == pytest.approx(CORRELATED_LINES, rel=0.001)
    assert variance([0, 3]) == 2.0
    assert variance([4, 5, 7]) == pytest.approx(3.0 + 2.0 * (4 / 9 + 1 / 36))
    # what one line has too much the next has too little: only the ends are left, but they are
    assert variance(list(range(99)), SMEARED_IN_PHASE) == pytest.approx(4 / 3)

    assert independent_segments(24, 0.0) == 24.0
    assert independent_segments(24, 0.125) == pytest.approx(24.0, rel=1e-3)
    # Hann at 50 %: neighbours correlate by 1/6 (Welch 1967; Harris 1978, table I)
    expected = 24 / (1.0 + 2.0 * (1.0 - 1 / 24) / 36.0)
    assert independent_segments(24, 0.5) == pytest.approx(expected, rel=1e-3)
    taper = signal.get_window("hann", 1024)
    three_quarters = float(taper[256:] @ taper[:-256]) / float(taper @ taper)
    assert independent_segments(2, 0.75) == pytest.approx(2.0 / (1.0 + three_quarters**2), rel=1e-3)


def test_what_integration_leaves_behind_hangs_together_as_stated():
    """White acceleration, integrated twice at the bins and in time, differs by the smear."""
    rng = np.random.default_rng(6)
    n_segments, bins = 400, np.arange(60, 160)
    omega = 2.0 * np.pi * np.fft.rfftfreq(16384, 1.0 / 600.0)[1:]
    tones = rng.normal(size=(2, n_segments, omega.size))
    spectrum = np.pad(tones[0] + 1j * tones[1], ((0, 0), (1, 0)))
    acceleration = np.fft.irfft(spectrum)[:, 4096:12288]
    spectrum[:, 1:] /= -(omega**2)
    spectrum[:, :30] = 0.0  # far below the bins looked at; their leakage is another matter
    displacement = np.fft.irfft(spectrum)[:, 4096:12288]
    moved = bin_phasors(tapered(displacement), 200)[:, bins]
    at_bins = bin_phasors(tapered(acceleration), 200)[:, bins]
    at_bins = at_bins / -((2.0 * np.pi * (bins + 1) * BIN_HZ) ** 2)

    left = at_bins - moved

    share = (np.abs(left) ** 2).mean(axis=0) / (np.abs(moved) ** 2).mean(axis=0)
    stated = SMEAR_BINS_SQUARED * (2.0 / (bins + 1)) ** 2
    assert np.mean(share / stated) == pytest.approx(1.0, abs=0.1)
    product = left * moved.conj() / (np.abs(moved) ** 2).mean(axis=0) * (bins + 1)
    for distance in (1, 2):
        for part, stated in (
            (product.real, SMEARED_IN_PHASE[distance]),
            (product.imag, SMEARED_IN_QUADRATURE[distance]),
        ):
            found = (part[:, :-distance] * part[:, distance:]).mean() / (part**2).mean()
            assert found == pytest.approx(stated, abs=0.03)
