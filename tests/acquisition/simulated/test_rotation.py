import numpy as np
import pytest

from acquisition.simulated.rotation import FollowedRotation, Rotation

RATE_HZ = 600.0
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
