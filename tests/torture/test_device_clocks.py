"""Devices whose clocks drift, or stamp their samples with years that cannot be."""

import time
from dataclasses import replace

import pytest
from harness.bench import bench_of
from harness.service_rig import until

DRIFT_PPM = 1000.0
DRIFTS_WITHIN_S = 600.0
"""It takes a minute until drift is told from delays, and lasts another one until it is an alarm."""

SLOTS = (1, 2, 20, 200)

pytestmark = pytest.mark.torture


@pytest.mark.timeout(3600)
def test_a_device_that_samples_too_fast_is_told_and_loses_nothing(plant, tmp_path, torture):
    with bench_of(replace(plant, drift_ppm=DRIFT_PPM), tmp_path, torture.seed) as bench:
        until(lambda: bench.active("clock_drift"), DRIFTS_WITHIN_S)
        clock = bench.clock()
        drift_ppm, u_ppm = clock["drift_ppm"], clock["drift_uncertainty_ppm"]
        assert abs(drift_ppm - DRIFT_PPM) <= 4.0 * u_ppm, clock
        assert bench.wrong() == {}
    torture.figure(
        f"a device {DRIFT_PPM:g} ppm too fast: found {drift_ppm:.0f} +- {u_ppm:.0f} ppm, told"
    )


@pytest.mark.timeout(3600)
def test_stamps_of_2106_are_told_and_no_result_has_their_time(plant, tmp_path, torture):
    n_expected = 0
    with bench_of(plant, tmp_path, torture.seed) as bench:
        for n_slots in SLOTS:
            bench.daq.tell(f"U1 wrong_time {n_slots}")
            n_expected += n_slots
            time.sleep(n_slots * plant.slot_samples / plant.rate_hz)
            until(lambda wanted=n_expected: bench.clock()["n_stamp_faults"] >= wanted)
        assert bench.clock()["n_stamp_faults"] == n_expected
        time.sleep(2.0 * plant.refresh_s)
        assert bench.wrong() == {}
    torture.figure(f"{n_expected} slots stamped 2106: all told, no result has that time")
