"""Stamps made from arrivals: smooth, rising, and right in the long run."""

import numpy as np
import pytest

from acquisition.host_stamps import HostStamps

NS_PER_S = 1_000_000_000
START_NS = 1_767_225_600 * NS_PER_S
RATE_HZ = 600.0


def arrivals(
    duration_s: float, drift: float = 0.0, jitter_s: float = 0.0, first_late_s: float = 0.0
):
    """Stop index and arrival of blocks of 50; the device runs faster by the drift."""
    random = np.random.default_rng(20261121)
    for n in range(1, int(duration_s * RATE_HZ / 50)):
        late_s = first_late_s if n == 1 else random.exponential(jitter_s) if jitter_s else 0.0
        at_s = n * 50 / RATE_HZ * (1.0 - drift) + late_s
        yield n * 50, START_NS + round(at_s * NS_PER_S)


def test_stamps_follow_the_nominal_rate_however_the_blocks_trickle_in():
    stamps = HostStamps(RATE_HZ)
    starts = []
    for stop, arrived_ns in arrivals(9.0, jitter_s=0.05):
        stamps.add(0, stop, arrived_ns)
        starts.append(stamps.start_ns(stop - 50))
    np.testing.assert_allclose(np.diff(starts), 50 / RATE_HZ * NS_PER_S, atol=1.0)


@pytest.mark.parametrize("drift", [-150e-6, 0.0, 20e-6, 150e-6])
def test_stamps_stay_with_the_host_for_hours_though_the_device_drifts(drift):
    stamps = HostStamps(RATE_HZ)
    previous = 0
    for stop, arrived_ns in arrivals(7200.0, drift, jitter_s=0.005, first_late_s=0.3):
        stamps.add(0, stop, arrived_ns)
        start = stamps.start_ns(stop - 50)
        assert (
            previous == 0 or abs(start - previous - 50 / RATE_HZ * NS_PER_S) < 601e-6 * 50e9 / 600
        )
        previous = start
    true_ns = START_NS + round((stop - 50) / RATE_HZ * (1.0 - drift) * NS_PER_S)
    assert abs(start - true_ns) < 3_000_000


def test_one_late_block_moves_nothing():
    stamps, undisturbed = HostStamps(RATE_HZ), HostStamps(RATE_HZ)
    for stop, arrived_ns in arrivals(60.0):
        stamps.add(0, stop, arrived_ns + (5 * NS_PER_S if stop == 20_000 else 0))
        undisturbed.add(0, stop, arrived_ns)
        assert stamps.start_ns(stop) == undisturbed.start_ns(stop)


@pytest.mark.parametrize("step_s", [-7200, 7200])
def test_a_host_clock_that_was_set_is_followed_at_once_or_after_ten_seconds(step_s):
    stamps = HostStamps(RATE_HZ)
    for stop, arrived_ns in arrivals(40.0):
        stepped_ns = arrived_ns + (step_s * NS_PER_S if stop > 6000 else 0)
        stamps.add(0, stop, stepped_ns)
    assert abs(stamps.start_ns(stop) - stepped_ns) < 1_000_000


def test_a_gap_in_the_index_takes_the_time_it_took_and_a_new_epoch_begins_a_new_line():
    stamps = HostStamps(RATE_HZ)
    stamps.add(0, 600, START_NS)
    stamps.add(0, 600 + 600 * 3600, START_NS + 3600 * NS_PER_S)
    assert stamps.start_ns(600 + 600 * 3600) == START_NS + 3600 * NS_PER_S
    stamps.add(1, 50, START_NS + 7200 * NS_PER_S)
    assert stamps.start_ns(50) == START_NS + 7200 * NS_PER_S
