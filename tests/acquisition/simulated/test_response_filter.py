from collections.abc import Callable

import numpy as np
import pytest
import scipy.signal

from acquisition.errors import ConfigError
from acquisition.simulated.accelerometer_noise import AccelerometerNoise
from acquisition.simulated.response_filter import ResponseFilter
from core.arrays import FloatArray
from core.transducer_response import HighPass, Resonance, Response, ResponseChain, ResponseTable

RATE_HZ = 600.0
ACCELEROMETER = ResponseChain((HighPass(0.5), Resonance(2500.0, 0.02)))
RESPONSES: dict[str, Response] = {
    "accelerometer": ACCELEROMETER,
    "slow charge amplifier": HighPass(0.02, order=2),
    "charge amplifier": HighPass(0.5, order=2),
    "velocity pickup": HighPass(4.5, order=2, damping=0.56),
    "soft mounting": Resonance(60.0, 0.1),
    "chain of chains": ResponseChain((ACCELEROMETER, HighPass(0.3, order=2), HighPass(3.0))),
}


@pytest.mark.parametrize("rate_hz", [600.0, 1200.0])
@pytest.mark.parametrize("name", RESPONSES)
def test_the_samples_have_the_response_of_the_transducer(name: str, rate_hz: float) -> None:
    response = RESPONSES[name]
    frequency_hz = np.geomspace(0.1, 25.0, 100)

    off = ResponseFilter(response, rate_hz).response_at(frequency_hz, rate_hz) - response.at(
        frequency_hz
    )

    assert np.abs(off / response.at(frequency_hz)).max() < 5e-4


@pytest.mark.parametrize("name", RESPONSES)
def test_a_filter_joins_from_piece_to_piece_without_a_seam(name: str) -> None:
    signal: FloatArray = np.random.default_rng(1).standard_normal(3000)
    whole = ResponseFilter(RESPONSES[name], RATE_HZ).advance(signal)
    stream = ResponseFilter(RESPONSES[name], RATE_HZ)

    pieces = [stream.advance(piece) for piece in np.split(signal, [1, 3, 100, 2048])]

    assert np.array_equal(np.concatenate(pieces), whole)


def test_a_standing_gap_leaves_no_transient() -> None:
    passed = ResponseFilter(Resonance(60.0, 0.1), RATE_HZ).advance(np.full(500, 2000.0))
    blocked = ResponseFilter(HighPass(0.5), RATE_HZ).advance(np.full(500, 2000.0))

    assert passed == pytest.approx(2000.0, rel=1e-3)
    assert np.ptp(passed) < 1e-6
    assert np.abs(blocked).max() < 1e-6


def test_a_response_that_samples_cannot_show_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"not within 0\.001, at"):
        ResponseFilter(Resonance(100.0, 0.3), 200.0)
    with pytest.raises(ConfigError, match="needs a model of its response, got a table"):
        ResponseFilter(ResponseTable((0.1, 10.0), (1.0, 1.0), (0.0, 0.0)), RATE_HZ)


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
