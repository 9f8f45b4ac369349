"""A device's clock against the host's, from arrivals that are late by chance."""

import numpy as np
import pytest

from acquisition.clock_estimate import ClockEstimate

NS = 1_000_000_000
HOST_NS = 1_767_225_600 * NS
RATE_HZ = 600.0
POLL_SAMPLES = 150


def watched(duration_s: float, drift_ppm: float, offset_s: float, seed: int) -> ClockEstimate:
    """Polls four times a second, each up to 80 ms late, of a device that samples too fast."""
    estimate, random = ClockEstimate(), np.random.default_rng(seed)
    sample_s = 1.0 / (RATE_HZ * (1.0 + drift_ppm * 1e-6))
    for n in range(1, int(duration_s * RATE_HZ / POLL_SAMPLES)):
        true_s = n * POLL_SAMPLES * sample_s
        arrived_ns = HOST_NS + round((true_s + 0.002 + random.uniform(0.0, 0.08)) * NS)
        stamp_ns = HOST_NS + round((true_s + offset_s) * NS)
        estimate.add(1, n * POLL_SAMPLES, RATE_HZ, stamp_ns, arrived_ns)
    return estimate


@pytest.mark.parametrize("drift_ppm", [-150.0, 0.0, 35.0, 400.0])
def test_drift_is_found_within_three_of_its_stated_uncertainty(drift_ppm) -> None:
    for seed in range(10):
        clock = watched(1800.0, drift_ppm, 0.0, seed).reading()
        assert clock.u_drift_ppm < 3.0
        assert abs(clock.drift_ppm - drift_ppm) < 3.0 * clock.u_drift_ppm + 0.1


def test_offset_is_read_at_the_least_delay() -> None:
    clock = watched(120.0, 0.0, 7.25, seed=1).reading()
    assert clock.offset_s == pytest.approx(7.25 - 0.002, abs=0.01)


def test_drift_is_not_told_before_there_is_enough_to_tell() -> None:
    assert watched(30.0, 0.0, 0.0, seed=1).reading().drift_ppm is None


def test_a_device_without_stamps_has_a_drift_but_no_offset() -> None:
    estimate = ClockEstimate()
    for n in range(600):
        estimate.add(1, 600 * n, RATE_HZ, None, HOST_NS + n * NS)
    clock = estimate.reading()
    assert clock.offset_s is None
    assert clock.drift_ppm == pytest.approx(0.0, abs=0.01)


def test_a_restart_begins_the_estimate_anew() -> None:
    estimate = watched(600.0, 100.0, 0.0, seed=3)
    estimate.add(2, 0, RATE_HZ, HOST_NS, HOST_NS)
    assert estimate.reading().drift_ppm is None


def test_memory_is_bounded() -> None:
    estimate = ClockEstimate()
    for n in range(20_000):
        estimate.add(1, 6000 * n, RATE_HZ, None, HOST_NS + 10 * n * NS)
    assert len(estimate._bins) == 360
