from collections.abc import Callable

import numpy as np
import pytest
import scipy.signal

from acquisition.simulated.accelerometer_noise import AccelerometerNoise
from core.arrays import FloatArray

RATE_HZ = 600.0
DENSITY_G = 5e-6
CORNER_HZ = 2.0


def noise(seed: int = 1) -> AccelerometerNoise:
    random = np.random.default_rng(seed)
    return AccelerometerNoise(random, (False, True), DENSITY_G, CORNER_HZ, RATE_HZ)


def mm_s_per_m_s2(frequency_hz: FloatArray) -> FloatArray:
    return 1e3 / (2 * np.pi * frequency_hz.clip(0.01))


def density(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    return scipy.signal.welch(samples, RATE_HZ, nperseg=1 << 14)


@pytest.mark.parametrize(("channel", "per_m_s2"), [(0, lambda _: 1.0), (1, mm_s_per_m_s2)])
def test_the_noise_has_the_density_of_its_data_sheet_and_rises_below_its_corner(
    channel: int, per_m_s2: Callable[[FloatArray], FloatArray]
) -> None:
    """A velocity channel carries the integral of such noise."""
    frequency_hz, power = density(noise().advance(1_200_000)[channel])
    white = (DENSITY_G * 9.80665 * per_m_s2(frequency_hz)) ** 2
    expected = white * (1 + CORNER_HZ / frequency_hz.clip(0.01))

    # 145 independent segments: 8 % a line, bands of 10 lines and more 3 % and less. Of the
    # integral, the floor at 0.1 Hz takes 0.4 % at 0.4 Hz, and the window's leakage adds some.
    for low_hz, high_hz in ((0.4, 0.8), (0.8, 2.0), (2.0, 6.0), (6.0, 25.0), (25.0, 250.0)):
        band = (frequency_hz >= low_hz) & (frequency_hz < high_hz)
        if channel == 0 or high_hz <= 25.0:
            assert power[band].sum() == pytest.approx(expected[band].sum(), rel=0.06)


def test_integrated_noise_neither_runs_away_nor_steps_from_chunk_to_chunk() -> None:
    stream = noise(2)
    early, _, late = (stream.advance(600_000)[1] for _ in range(3))

    assert np.abs(late).max() < 2.0 * np.abs(early).max()
    assert abs(late.mean()) < 0.05 * late.std()
    velocity = np.concatenate([stream.advance(2048)[1] for _ in range(50)])
    steps = np.abs(np.diff(velocity))
    assert steps[2047::2048].mean() == pytest.approx(steps.mean(), rel=0.5)


def test_no_two_channels_share_their_noise() -> None:
    two = AccelerometerNoise(np.random.default_rng(4), (False, False), 1.0, 2.0, RATE_HZ)

    first, second = two.advance(600_000)
    assert abs(np.mean(first * second)) < 0.05 * first.std() * second.std()
