"""Polls that find out how fast a device samples, though its slots and the polls keep step."""

import numpy as np
import pytest

from acquisition.arrival import Arrival
from acquisition.clock_estimate import ClockEstimate
from acquisition.modbus.ring_pace import out_of_step_s
from core.alarms.conditions import drift_reading

RATE_HZ = 600.0
DURATION_S = 1800.0
LIMIT_PPM = 200.0
"""The default of ``max_clock_drift_ppm``."""


def readings(drift_ppm: float, period_s: float, slot_samples: int, seed: int):
    """What is told every ten seconds of a ring on a line that takes 3 ms and at times some more."""
    random, estimate = np.random.default_rng(seed), ClockEstimate()
    slot_s = slot_samples / RATE_HZ
    begun_s = random.uniform(0.0, slot_s)
    told_s, seen, pace_s = 0.0, 0, out_of_step_s(period_s, slot_s)
    for polled_s in np.arange(pace_s, DURATION_S, pace_s).tolist():
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


@pytest.mark.parametrize("slot_s", [0.01, 0.0833, 0.1, 0.24, 0.25, 0.26, 0.5, 1.0, 7.0])
def test_polls_come_no_later_than_asked_for_and_not_much_sooner(slot_s) -> None:
    period_s = out_of_step_s(0.25, slot_s)
    assert 0.5 * 0.25 < period_s <= 0.25
    if slot_s > 1.0 or slot_s < 0.05:
        assert period_s > 0.8 * 0.25
