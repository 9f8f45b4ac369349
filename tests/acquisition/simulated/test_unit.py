import math
import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.calibration import UnitCalibration, calibrate
from acquisition.errors import ConfigError
from acquisition.simulated.scenario import Scenario
from acquisition.simulated.unit import SimulatedUnit
from core.machine import Unit
from core.quality import Level

BuildUnit = Callable[..., SimulatedUnit]


def test_an_ordinary_day_is_the_same_in_every_version(
    build_unit: BuildUnit, full_load: Scenario, part_load: Scenario
) -> None:
    sums = [
        zlib.crc32(build_unit(s).advance(180_000).counts.tobytes()) for s in (full_load, part_load)
    ]

    assert sums == [3341452830, 3235138598]


def test_blocks_follow_on_each_other_in_index_and_time(
    build_unit: BuildUnit, full_load: Scenario
) -> None:
    unit = build_unit(full_load)
    start_ns = unit.advance(700).start_ns

    block = unit.advance(1)

    assert block.first_index == 700
    assert block.start_ns - start_ns == round(700 / 600.0 * 1e9)
    assert block.rate_hz == 600.0
    assert unit.advance(1).epoch == block.epoch


def test_a_healthy_unit_is_read_without_a_flag(
    build_unit: BuildUnit, calibration: UnitCalibration, full_load: Scenario, part_load: Scenario
) -> None:
    for scenario in (full_load, part_load):
        block = calibrate(build_unit(scenario).advance(60 * 600), calibration)

        assert all(quality.level is Level.GOOD for quality in block.channel_quality)


def test_slow_channels_agree_with_the_waveforms_and_the_truth(
    build_unit: BuildUnit, calibration: UnitCalibration, full_load: Scenario
) -> None:
    unit = build_unit(full_load)
    truth = unit.truth()
    block = calibrate(unit.advance(390), calibration)
    slow = {name: reading.value for name, reading in block.slow.items()}

    assert slow["speed"] == 92.3
    assert slow["power"] == pytest.approx(truth.active_power_mw)
    assert slow["not_there"] is None
    for index, name in enumerate(("UJB", "LJB", "TJB")):
        bearing = truth.bearings[name]
        assert slow[f"{name}_gap_x"] == pytest.approx((2000.0 - bearing.centre_x_um) / 1e3)
        assert slow[f"{name}_gap_y"] == pytest.approx((2100.0 - bearing.centre_y_um) / 1e3)
        assert slow[f"{name}_oil"] == pytest.approx(bearing.oil_temperature_c)
        # One turn of the waveform; hydraulic noise does not average out in it.
        assert block.samples[4 * index].mean() / 1e3 == pytest.approx(
            slow[f"{name}_gap_x"], abs=0.005
        )


def test_the_truth_is_what_equation_5_should_find(build_unit: BuildUnit, quiet: Scenario) -> None:
    truth = build_unit(quiet).truth().bearings["UJB"]

    assert truth.film.k_xx_n_per_m == 3.33e9
    assert truth.k_eff_xx_n_per_m == pytest.approx(3.33e9 * 1.0073, rel=1e-4)
    assert truth.eccentricity == pytest.approx(0.5)


def test_the_shaft_centre_and_the_oil_wander_slowly_by_what_the_scenario_says(
    build_unit: BuildUnit, quiet: Scenario
) -> None:
    wandering = {
        name: replace(b, centre_wander_um_rms=8.0, oil_temperature_wander_c_rms=0.7)
        for name, b in quiet.bearings.items()
    }
    unit = build_unit(replace(quiet, bearings=wandering, wander_time_s=30.0))
    centre_um, oil_c = [], []
    for _ in range(700):
        truth = unit.truth().bearings["UJB"]
        centre_um.append(truth.centre_x_um)
        oil_c.append(truth.oil_temperature_c)
        unit.advance(600)

    # 700 s of a wander of 30 s are about 12 independent values: 20 % scatter, two of it.
    assert np.std(centre_um) == pytest.approx(8.0, rel=0.4)
    assert np.std(oil_c) == pytest.approx(0.7, rel=0.4)
    assert np.abs(np.diff(centre_um)).max() < 8.0


def test_a_monitor_of_two_bearings_needs_no_third(
    machine: Unit, calibration: UnitCalibration, quiet: Scenario
) -> None:
    two = replace(machine, channels=machine.channels[:8], bearings=machine.bearings[:2])
    fitting = replace(calibration, channels=calibration.channels[:8])

    part = SimulatedUnit(two, fitting, quiet, seed=1, start_ns=0).advance(600)
    whole = SimulatedUnit(machine, calibration, quiet, seed=1, start_ns=0).advance(600)

    assert np.array_equal(part.counts, whole.counts[:8])
    assert all(math.isnan(value) for value in part.slow[-3:])


def test_settings_that_do_not_fit_together_are_refused(
    machine: Unit, calibration: UnitCalibration, quiet: Scenario
) -> None:
    without_turbine = {name: quiet.bearings[name] for name in ("UJB", "LJB")}
    wrong = [
        (replace(calibration, channels=calibration.channels[1:]), quiet, "12 channels.* 11"),
        (replace(calibration, rate_hz=500.0), quiet, "600.0 Hz.* 500.0 Hz"),
        (calibration, replace(quiet, bearings=without_turbine), "lacks TJB"),
    ]
    for fitted, scenario, message in wrong:
        with pytest.raises(ConfigError, match=message):
            SimulatedUnit(machine, fitted, scenario, seed=1, start_ns=0)
    with pytest.raises(ValueError, match="at least 1 sample, got 0"):
        SimulatedUnit(machine, calibration, quiet, seed=1, start_ns=0).advance(0)
