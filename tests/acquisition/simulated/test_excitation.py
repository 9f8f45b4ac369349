from collections.abc import Callable

import numpy as np
import pytest
import scipy.signal

from acquisition.simulated.excitation import (
    Excitation,
    HydraulicForce,
    RopeForce,
    UnbalanceForce,
)
from acquisition.simulated.rotation import FollowedRotation, Rotation

RATE_HZ = 600.0


def rotation(turn_hz: float, speed_wander: float = 0.0) -> Rotation:
    return Rotation(np.random.default_rng(7), turn_hz, RATE_HZ, speed_wander)


STREAMS: dict[str, Callable[[], Excitation]] = {
    "unbalance": lambda: UnbalanceForce(1.0, rotation(1.538, 0.003)),
    "rope": lambda: RopeForce(np.random.default_rng(1), 1.0, 0.385, 0.01, RATE_HZ),
    "white": lambda: HydraulicForce(np.random.default_rng(2), 1.0, None, RATE_HZ),
    "band": lambda: HydraulicForce(np.random.default_rng(3), 1.0, 20.0, RATE_HZ),
}


@pytest.mark.parametrize("name", STREAMS)
def test_a_force_joins_from_piece_to_piece_without_a_seam(name: str) -> None:
    whole = STREAMS[name]().advance(1000)
    stream = STREAMS[name]()
    pieces = [stream.advance(n) for n in (1, 2, 97, 400, 500)]

    assert np.array_equal(np.concatenate(pieces, axis=1), whole)


def test_unbalance_turns_forward_once_per_revolution_with_constant_force() -> None:
    x, y = UnbalanceForce(75.6e3, rotation(1.5)).advance(800)
    angle = np.unwrap(np.arctan2(y, x))

    assert np.hypot(x, y) == pytest.approx(75.6e3)
    assert angle == pytest.approx(2 * np.pi * 1.5 / RATE_HZ * np.arange(800))


def test_unbalance_grows_with_the_square_of_the_speed() -> None:
    wandering = rotation(1.5, 0.01)
    force = np.hypot(*UnbalanceForce(75.6e3, wandering).advance(60_000))

    assert force == pytest.approx(75.6e3 * wandering.relative_speed(np.arange(60_000.0)) ** 2)
    assert np.ptp(force) > 500.0


@pytest.mark.parametrize("cutoff_hz", [None, 20.0, 5.0])
def test_hydraulic_force_has_the_rms_and_the_band_it_is_given(cutoff_hz: float | None) -> None:
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


def test_the_rope_keeps_its_mean_frequency_but_no_fixed_phase_to_the_shaft() -> None:
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


def test_the_shaft_turns_as_fast_as_its_speed_says_which_wanders_by_what_it_is_told() -> None:
    index = np.arange(0.0, 300.0 * RATE_HZ)
    rotation = wandering()

    measured = np.gradient(rotation.turns(index)) * RATE_HZ / TURN_HZ

    assert measured[1:-1] == pytest.approx(rotation.relative_speed(index)[1:-1], abs=1e-7)
    relative = rotation.relative_speed(np.arange(0.0, 7200.0 * RATE_HZ, 600.0))
    assert np.abs(relative - 1.0).max() <= 0.003
    assert np.ptp(relative) > 0.004
    assert relative.mean() == pytest.approx(1.0, abs=1e-4)


def test_without_wander_the_turns_are_even() -> None:
    even = Rotation(np.random.default_rng(1), TURN_HZ, RATE_HZ)
    index = np.arange(10_000.0)

    assert np.array_equal(even.turns(index), TURN_HZ / RATE_HZ * index)
    assert np.array_equal(even.relative_speed(index), np.ones(10_000))


def test_a_shaft_that_is_followed_turns_by_its_mean_speed_without_a_jump() -> None:
    rotation, passed = FollowedRotation(60.0, RATE_HZ), []
    for number, (start_rpm, stop_rpm) in enumerate(((60.0, 60.0), (60.0, 30.0), (30.0, 0.0))):
        rotation.follow(600 * number, 600, start_rpm, stop_rpm)
        index = np.arange(600.0 * number, 600.0 * number + 601.0)
        turns, relative = rotation.turns(index), rotation.relative_speed(index)
        assert np.diff(turns) * RATE_HZ == pytest.approx((relative[1:] + relative[:-1]) / 2.0)
        passed += [turns[0], turns[-1]]
    assert passed == pytest.approx([0.0, 1.0, 1.0, 1.75, 1.75, 2.0])
