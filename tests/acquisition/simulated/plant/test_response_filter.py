"""Forces on a simulated machine, and the response and noise of its transducers."""

import numpy as np
import pytest
import scipy.signal

from acquisition.errors import ConfigError
from acquisition.simulated.plant.chain import AccelerometerNoise
from acquisition.simulated.plant.excitation import (
    FollowedRotation,
    HydraulicForce,
    RopeForce,
    Rotation,
    UnbalanceForce,
)
from acquisition.simulated.plant.response_filter import ResponseFilter
from core.arrays import FloatArray
from core.machine.response import HighPass, Resonance, Response, ResponseChain, ResponseTable

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
def test_the_samples_have_the_response_of_the_transducer(name, rate_hz):
    response = RESPONSES[name]
    frequency_hz = np.geomspace(0.1, 25.0, 100)

    off = ResponseFilter(response, rate_hz).response_at(frequency_hz, rate_hz) - response.at(
        frequency_hz
    )

    assert np.abs(off / response.at(frequency_hz)).max() < 5e-4


def test_a_standing_gap_leaves_no_transient():
    passed = ResponseFilter(Resonance(60.0, 0.1), RATE_HZ).advance(np.full(500, 2000.0))
    blocked = ResponseFilter(HighPass(0.5), RATE_HZ).advance(np.full(500, 2000.0))

    assert passed == pytest.approx(2000.0, rel=1e-3)
    assert np.ptp(passed) < 1e-6
    assert np.abs(blocked).max() < 1e-6


def test_a_response_that_samples_cannot_show_is_refused():
    with pytest.raises(ConfigError, match=r" Hz, at most 0\.001 is allowed"):
        ResponseFilter(Resonance(100.0, 0.3), 200.0)
    with pytest.raises(ConfigError, match="requires a model of its response, got a table"):
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
def test_the_noise_has_the_density_of_its_data_sheet_and_rises_below_its_corner(channel, per_m_s2):
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


def test_integrated_noise_neither_runs_away_nor_steps_from_chunk_to_chunk():
    stream = noise(2)
    early, _, late = (stream.advance(600_000)[1] for _ in range(3))

    assert np.abs(late).max() < 2.0 * np.abs(early).max()
    assert abs(late.mean()) < 0.05 * late.std()
    velocity = np.concatenate([stream.advance(2048)[1] for _ in range(50)])
    steps = np.abs(np.diff(velocity))
    assert steps[2047::2048].mean() == pytest.approx(steps.mean(), rel=0.5)


def test_no_two_channels_share_their_noise():
    two = AccelerometerNoise(np.random.default_rng(4), (False, False), 1.0, 2.0, RATE_HZ)

    first, second = two.advance(600_000)
    assert abs(np.mean(first * second)) < 0.05 * first.std() * second.std()


def rotation(turn_hz: float, speed_wander: float = 0.0) -> Rotation:
    return Rotation(np.random.default_rng(7), turn_hz, RATE_HZ, speed_wander)


def test_unbalance_turns_forward_once_per_revolution_with_constant_force():
    x, y = UnbalanceForce(75.6e3, rotation(1.5)).advance(800)
    angle = np.unwrap(np.arctan2(y, x))

    assert np.hypot(x, y) == pytest.approx(75.6e3)
    assert angle == pytest.approx(2 * np.pi * 1.5 / RATE_HZ * np.arange(800))


def test_unbalance_grows_with_the_square_of_the_speed():
    wandering = rotation(1.5, 0.01)
    force = np.hypot(*UnbalanceForce(75.6e3, wandering).advance(60_000))

    assert force == pytest.approx(75.6e3 * wandering.relative_speed(np.arange(60_000.0)) ** 2)
    assert np.ptp(force) > 500.0


@pytest.mark.parametrize("cutoff_hz", [None, 20.0, 5.0])
def test_hydraulic_force_has_the_rms_and_the_band_it_is_given(cutoff_hz):
    force = HydraulicForce(np.random.default_rng(4), 20.0e3, cutoff_hz, RATE_HZ).advance(600_000)

    # 1000 s of a 5 Hz band are 10,000 independent values: 1 % scatter at most.
    assert force[:, 6000:].std(axis=1) == pytest.approx([20.0e3] * 2, rel=0.03)
    assert abs(np.corrcoef(force[0], force[1]).min()) < 0.05
    frequency_hz, density = scipy.signal.welch(force, RATE_HZ, nperseg=8192)
    edge_hz = cutoff_hz or RATE_HZ / 2.0
    below = density[:, (frequency_hz > 1.0) & (frequency_hz < 0.75 * edge_hz)].mean()
    assert below == pytest.approx(20.0e3**2 / edge_hz, rel=0.06)
    if cutoff_hz:
        assert density[:, frequency_hz > 3.0 * edge_hz].mean() < 1e-3 * below


def test_the_rope_keeps_its_mean_frequency_but_no_fixed_phase_to_the_shaft():
    width_hz, seconds = 0.01, 20_000
    rope = RopeForce(np.random.default_rng(6), 150.0e3, 0.385, width_hz, 10.0)
    x, y = rope.advance(seconds * 10)
    turning = x + 1j * y
    angle = np.unwrap(np.angle(turning))
    wander = angle - 2 * np.pi * 0.385 * np.arange(angle.size) / 10.0
    after_10_s = wander[100::100] - wander[:-100:100]

    assert np.abs(turning) == pytest.approx(150.0e3)
    assert angle[-1] / (2 * np.pi * seconds) == pytest.approx(0.385, abs=0.001)
    # Random walk of a Lorentzian line: variance 2π · width · time; 2000 steps scatter by 3 %.
    assert after_10_s.var() == pytest.approx(2 * np.pi * width_hz * 10.0, rel=0.15)


TURN_HZ = 92.3 / 60.0


def wandering() -> Rotation:
    return Rotation(np.random.default_rng(1), TURN_HZ, RATE_HZ, 0.003, 120.0)


@pytest.mark.long
def test_the_shaft_turns_as_fast_as_its_speed_says_which_wanders_by_what_it_is_told():
    index = np.arange(0.0, 300.0 * RATE_HZ)
    rotation = wandering()

    measured = np.gradient(rotation.turns(index)) * RATE_HZ / TURN_HZ

    assert measured[1:-1] == pytest.approx(rotation.relative_speed(index)[1:-1], abs=1e-7)
    relative = rotation.relative_speed(np.arange(0.0, 7200.0 * RATE_HZ, 600.0))
    assert np.abs(relative - 1.0).max() <= 0.003
    assert np.ptp(relative) > 0.004
    assert relative.mean() == pytest.approx(1.0, abs=1e-4)


def test_a_shaft_that_is_followed_turns_by_its_mean_speed_without_a_jump():
    rotation, passed = FollowedRotation(60.0, RATE_HZ), []
    for number, (start_rpm, stop_rpm) in enumerate(((60.0, 60.0), (60.0, 30.0), (30.0, 0.0))):
        rotation.follow(600 * number, 600, start_rpm, stop_rpm)
        index = np.arange(600.0 * number, 600.0 * number + 601.0)
        turns, relative = rotation.turns(index), rotation.relative_speed(index)
        assert np.diff(turns) * RATE_HZ == pytest.approx((relative[1:] + relative[:-1]) / 2.0)
        passed += [turns[0], turns[-1]]
    assert passed == pytest.approx([0.0, 1.0, 1.0, 1.75, 1.75, 2.0])
