"""A device's clock against the host's, from arrivals that are late by chance."""

from collections.abc import Callable

import numpy as np
import pytest
from rigs.tiers import fast_and_long

from acquisition.clock import FastClock
from acquisition.delivery.arrival import Arrival, ArrivalModel

NS = 1_000_000_000
HOST_NS = 1_767_225_600 * NS
RATE_HZ = 600.0
POLL_SAMPLES = 150


def arrival(after_s: float, wrong_s: float = 0.0) -> Arrival:
    """So long after the start, by a host's clock that is wrong."""
    return Arrival(HOST_NS + round((after_s + wrong_s) * NS), 5000.0 + after_s)


def watched(
    duration_s: float,
    drift_ppm: float,
    offset_s: float,
    seed: int,
    wrong_s: Callable[[float], float] = lambda after_s: 0.0,  # noqa: ARG005
) -> ArrivalModel:
    """Polls four times a second, each up to 80 ms late, of a device that samples too fast.

    How wrong the host's clock is may change with time.
    """
    estimate, random = ArrivalModel(RATE_HZ), np.random.default_rng(seed)
    sample_s = 1.0 / (RATE_HZ * (1.0 + drift_ppm * 1e-6))
    for n in range(1, int(duration_s * RATE_HZ / POLL_SAMPLES)):
        true_s = n * POLL_SAMPLES * sample_s
        arrived_s = true_s + 0.002 + random.uniform(0.0, 0.08)
        stamp_ns = HOST_NS + round((true_s + offset_s) * NS)
        arrived = arrival(arrived_s, wrong_s(arrived_s))
        estimate.add(1, n * POLL_SAMPLES, stamp_ns, arrived)
    return estimate


@pytest.mark.parametrize("n_seeds", fast_and_long(3, 10))
@pytest.mark.parametrize("drift_ppm", [-150.0, 0.0, 35.0, 400.0])
def test_drift_is_found_within_three_of_its_stated_uncertainty(drift_ppm, n_seeds) -> None:
    for seed in range(n_seeds):
        clock = watched(1800.0, drift_ppm, 0.0, seed).device_clock()
        assert clock.u_drift_ppm < 3.0
        assert abs(clock.drift_ppm - drift_ppm) < 3.0 * clock.u_drift_ppm + 0.1


@pytest.mark.parametrize(
    ("offset_s", "step_s", "within_s"),
    [(7.25 - 0.002, 0.0, 0.01), (0.0, 7200.0, 0.1), (0.0, -3600.0, 0.1)],
)
def test_offset_is_read_at_the_least_delay_by_the_hosts_clock_as_it_stands_now(
    offset_s, step_s, within_s
) -> None:
    estimate = watched(600.5, 0.0, offset_s + 0.002, 5, lambda s: step_s if s > 600.0 else 0.0)
    assert estimate.device_clock().offset_s == pytest.approx(offset_s - step_s, abs=within_s)


def test_a_device_without_stamps_has_a_drift_but_no_offset() -> None:
    estimate = ArrivalModel(RATE_HZ)
    for n in range(600):
        estimate.add(1, 600 * n, None, arrival(n))
    clock = estimate.device_clock()
    assert clock.offset_s is None
    assert clock.drift_ppm == pytest.approx(0.0, abs=0.01)


def test_drift_is_not_told_before_there_is_enough_to_tell_also_after_a_restart() -> None:
    assert watched(30.0, 0.0, 0.0, seed=1).device_clock().drift_ppm is None
    estimate = watched(600.0, 100.0, 0.0, seed=3)
    estimate.add(2, 0, HOST_NS, arrival(600.0))
    assert estimate.device_clock().drift_ppm is None


def test_memory_is_bounded() -> None:
    estimate = ArrivalModel(RATE_HZ)
    for n in range(5000):
        estimate.add(1, 6000 * n, None, arrival(10.0 * n))
    assert len(estimate._bins) == 360


@pytest.mark.parametrize("step_s", [7200.0, 0.4, -1.0, -1.79e9])
def test_a_step_of_the_hosts_clock_is_no_drift_of_the_device(step_s) -> None:
    for after_s in (601.0, 690.0, 1200.0):
        estimate = watched(after_s, 20.0, 0.0, 5, lambda s: step_s if s > 600.0 else 0.0)
        clock = estimate.device_clock()
        if after_s > 680.0 or clock.drift_ppm is not None:
            assert abs(clock.drift_ppm - 20.0) < 5.0 * clock.u_drift_ppm + 0.1


def test_a_device_that_drifts_is_still_found_to_where_the_clock_is_set_again_and_again() -> None:
    estimate = watched(1290.0, 400.0, 0.0, 5, lambda s: 3600.0 * (s // 100.0))
    clock = estimate.device_clock()
    assert clock.drift_ppm == pytest.approx(400.0, abs=3.0 * clock.u_drift_ppm)


def test_a_host_that_was_suspended_takes_that_for_no_drift() -> None:
    """Its steady clock stood still meanwhile, and the device went on."""
    estimate, asleep_s = ArrivalModel(RATE_HZ), 300.0
    for n in range(900):
        slept_s = asleep_s if n > 300 else 0.0
        awake = Arrival(HOST_NS + round((n + slept_s) * NS), float(n))
        estimate.add(1, round(RATE_HZ * (n + slept_s)), None, awake)
    assert estimate.device_clock().drift_ppm == pytest.approx(0.0, abs=0.01)


async def test_a_fast_clock_passes_a_day_in_a_fiftieth_of_it(stepped_clock) -> None:
    clock = FastClock(stepped_clock, 50.0)
    start_ns = clock.now_ns()
    assert start_ns == stepped_clock.now_ns()

    await clock.sleep(86_400.0)

    assert stepped_clock.monotonic_s() == pytest.approx(1728.0)
    assert clock.monotonic_s() == pytest.approx(86_400.0)
    assert clock.now_ns() - start_ns == 86_400_000_000_000


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_clock_that_does_not_run_forward_is_refused(stepped_clock, speed) -> None:
    with pytest.raises(ValueError, match="speed must be above 0"):
        FastClock(stepped_clock, speed)
