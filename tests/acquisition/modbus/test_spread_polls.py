"""Polls that find out how fast a device samples, though its slots and the polls keep step."""

import itertools

import numpy as np
import pytest

from acquisition.arrival import Arrival
from acquisition.clock_estimate import ClockEstimate
from acquisition.modbus.spread_polls import SpreadPolls
from core.alarms.conditions import drift_reading

RATE_HZ = 600.0
DURATION_S = 1800.0
LIMIT_PPM = 200.0
"""The default of ``max_clock_drift_ppm``."""


def poll_times_s(period_s: float, slot_s: float):
    polls, now_s = SpreadPolls(period_s, slot_s, 0.0), 0.0
    while now_s < DURATION_S:
        now_s += polls.wait_s(now_s)
        yield now_s


def readings(drift_ppm: float, period_s: float, slot_samples: int, seed: int):
    """What is told every ten seconds of a ring on a line that takes 3 ms and at times some more."""
    random, estimate = np.random.default_rng(seed), ClockEstimate()
    slot_s = slot_samples / RATE_HZ
    begun_s = random.uniform(0.0, slot_s)
    told_s, seen = 0.0, 0
    for polled_s in poll_times_s(period_s, slot_s):
        n_slots = int((begun_s + polled_s) * (1.0 + drift_ppm * 1e-6) / slot_s)
        if n_slots == seen:
            continue
        seen = n_slots
        arrived_s = polled_s + 0.003 + random.exponential(0.002)
        arrived = Arrival(1_767_225_600 * 10**9 + round(arrived_s * 1e9), arrived_s)
        estimate.add(1, n_slots * slot_samples, RATE_HZ, None, arrived)
        if polled_s - told_s >= 10.0:
            told_s = polled_s
            yield estimate.reading()


@pytest.mark.parametrize(("period_s", "slot_samples"), [(0.25, 50), (0.25, 600), (1.0, 60)])
@pytest.mark.parametrize("drift_ppm", [-50.0, 0.0, 10.0, 100.0, 150.0, 1000.0])
def test_a_ring_that_is_polled_in_step_with_its_slots_tells_its_drift(
    drift_ppm, period_s, slot_samples
) -> None:
    for seed in range(5):
        found = list(readings(drift_ppm, period_s, slot_samples, seed))
        assert found[-1].u_drift_ppm < 5.0
        assert abs(found[-1].drift_ppm - drift_ppm) < 3.0 * found[-1].u_drift_ppm + 0.5
        surely_ppm = [drift_reading(clock).value or 0.0 for clock in found]
        lasts = [min(surely_ppm[n : n + 6]) for n in range(len(surely_ppm) - 5)]
        assert (max(lasts) > LIMIT_PPM) == (drift_ppm > LIMIT_PPM)


@pytest.mark.parametrize(("period_s", "slot_s"), [(0.25, 0.083), (0.25, 1.0), (0.1, 0.1)])
def test_polls_come_once_a_period_and_none_is_late(period_s, slot_s) -> None:
    times_s = list(itertools.islice(poll_times_s(period_s, slot_s), 1000))
    due_s = period_s * np.arange(1, 1001)
    assert (times_s <= due_s + 1e-9).all()
    assert np.diff(times_s).max() < 1.4 * period_s
    assert np.diff(times_s).min() > 0.35 * period_s


def test_polls_that_are_overdue_are_left_out() -> None:
    polls = SpreadPolls(1.0, 0.1, 0.0)
    assert 0.9 <= polls.wait_s(0.0) <= 1.0
    assert polls.wait_s(7.3) == 0.0
    assert 0.9 <= polls.wait_s(7.3) <= 1.0
