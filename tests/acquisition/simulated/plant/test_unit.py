import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.signal

from acquisition.errors import ConfigError
from acquisition.simulated.feed import SimulatedSource
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.plant import CHUNK_SAMPLES, SimulatedPlant
from acquisition.simulated.plant.scenario import Scenario
from acquisition.simulated.plant.unit import SimulatedUnit
from acquisition.source import SampleSource
from core.arrays import FloatArray
from core.quality import Level
from core.samples.blocks import SampleBlock


def test_an_ordinary_day_is_the_same_in_every_version(build_unit, full_load, part_load):
    sums = [
        zlib.crc32(build_unit(s).advance(180_000).counts.tobytes()) for s in (full_load, part_load)
    ]

    assert sums == [3341452830, 3235138598]


def test_blocks_follow_on_each_other_in_index_and_time(build_unit, full_load):
    unit = build_unit(full_load)
    start_ns = unit.advance(700).start_ns

    block = unit.advance(1)

    assert block.first_index == 700
    assert block.start_ns - start_ns == round(700 / 600.0 * 1e9)
    assert block.rate_hz == 600.0
    assert unit.advance(1).epoch == block.epoch


def test_a_healthy_unit_is_read_without_a_flag(build_unit, full_load, part_load):
    for scenario in (full_load, part_load):
        block = build_unit(scenario).advance(60 * 600)

        assert all(quality.level is Level.GOOD for quality in block.channel_quality)


def test_slow_channels_agree_with_the_waveforms_and_the_truth(build_unit, full_load):
    unit = build_unit(full_load)
    truth = unit.truth()
    block = unit.advance(390)
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


def test_the_truth_is_what_equation_5_should_find(build_unit, quiet):
    truth = build_unit(quiet).truth().bearings["UJB"]

    assert truth.film.k_xx_n_per_m == 3.33e9
    assert truth.k_eff_xx_n_per_m == pytest.approx(3.33e9 * 1.0073, rel=1e-4)
    assert truth.eccentricity == pytest.approx(0.5)


def test_the_shaft_centre_and_the_oil_wander_slowly_by_what_the_scenario_says(build_unit, quiet):
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


def test_a_monitor_of_two_bearings_needs_no_third(machine, calibration, quiet):
    two = replace(machine, channels=machine.channels[:8], bearings=machine.bearings[:2])
    fitting = replace(calibration, channels=calibration.channels[:8])

    part = SimulatedUnit(two, fitting, quiet, seed=1, start_ns=0).advance(600)
    whole = SimulatedUnit(machine, calibration, quiet, seed=1, start_ns=0).advance(600)

    assert np.array_equal(part.counts, whole.counts[:8])
    assert all(math.isnan(value) for value in part.side.slow[-3:, 0])


def test_settings_that_do_not_fit_together_are_refused(machine, calibration, quiet):
    without_turbine = {name: quiet.bearings[name] for name in ("UJB", "LJB")}
    wrong = [
        (replace(calibration, channels=calibration.channels[1:]), quiet, "12 channels.* 11"),
        (replace(calibration, rate_hz=500.0), quiet, "600.0 Hz.* 500.0 Hz"),
        (calibration, replace(quiet, bearings=without_turbine), "add TJB to the scenario"),
    ]
    for fitted, scenario, message in wrong:
        with pytest.raises(ConfigError, match=message):
            SimulatedUnit(machine, fitted, scenario, seed=1, start_ns=0)
    with pytest.raises(ValueError, match="n_samples must be at least 1, got 0"):
        SimulatedUnit(machine, calibration, quiet, seed=1, start_ns=0).advance(0)


async def take(
    source: SampleSource, n_blocks: int, between: Callable[[], None] = lambda: None
) -> list[SampleBlock]:
    blocks: list[SampleBlock] = []
    async with source.connect() as stream:
        async for block in stream:
            blocks.append(block)
            if len(blocks) == n_blocks:
                break
            between()
    return blocks


async def test_an_unpaced_source_is_continued(build_unit, calibration, stepped_clock, full_load):
    feed = build_unit(full_load)
    in_500s = replace(calibration, block_samples=500)
    source = SimulatedSource(feed, in_500s, stepped_clock, paced=False)

    blocks = await take(source, 3)
    stepped_clock.step(3600.0)
    blocks += await take(source, 2)

    assert [block.first_index for block in blocks] == [0, 500, 1000, 1500, 2000]
    assert stepped_clock.monotonic_s() == 3600.0
    expected = build_unit(full_load).advance(2500)
    assert np.array_equal(np.concatenate([b.samples for b in blocks], axis=1), expected.samples)


@pytest.mark.parametrize(("busy_s", "finished_s"), [(0.0, 2.5), (2.0, 8.5)])
async def test_a_paced_source_delivers_samples_once_they_have_happened_and_loses_none(
    build_unit, calibration, stepped_clock, full_load, busy_s, finished_s
):
    """Also to a reader that is busy for longer than a block lasts."""
    in_halves = replace(calibration, block_samples=300)
    source = SimulatedSource(build_unit(full_load), in_halves, stepped_clock)

    blocks = await take(source, 5, lambda: stepped_clock.step(busy_s))

    assert [block.first_index for block in blocks] == [0, 300, 600, 900, 1200]
    assert stepped_clock.monotonic_s() == pytest.approx(finished_s)


RATE_HZ = 600.0
CHUNK_S = CHUNK_SAMPLES / RATE_HZ
SHAFT, BEARING = 0, 2
"""Rows of the UJB's first probe and first velocity channel."""


@dataclass(frozen=True)
class Told:
    """A course told as a function of time."""

    scenario: Callable[[float], Scenario]
    rated_speed_rpm: float = 92.3

    def at(self, elapsed_s: float) -> Scenario:
        return self.scenario(elapsed_s)


def softened(scenario: Scenario, share: float) -> Scenario:
    """The UJB has lost a share of its stiffness."""
    upper = scenario.bearings["UJB"]
    film = Film.proportional(*(2 * [(1.0 - share) * 3.33e9]))
    return replace(scenario, bearings={**scenario.bearings, "UJB": replace(upper, film=film)})


def readings(plant: SimulatedPlant, n_chunks: int) -> FloatArray:
    return np.concatenate([plant.advance().readings for _ in range(n_chunks)], axis=1)


def test_a_film_that_softens_within_a_minute_leaves_no_click(machine, quiet):
    course = Told(lambda s: softened(quiet, 0.2 * min(max(s - 7.0, 0.0) / 60.0, 1.0)))
    seen = readings(SimulatedPlant(machine, course, 3), 24)[BEARING]
    before, after = (np.ptp(seen[part]) for part in (slice(0, 3000), slice(-3000, None)))

    assert abs(after / before - 1.0) > 0.02  # the film did soften
    high = scipy.signal.sosfiltfilt(
        scipy.signal.butter(4, 60.0, "highpass", fs=RATE_HZ, output="sos"), seen
    )
    assert np.max(np.abs(high[600:-600])) < 1e-3 * before


def test_a_shaft_that_moves_over_and_a_load_that_rises_leave_no_step(machine, quiet):
    def moved(elapsed_s: float) -> Scenario:
        upper = replace(quiet.bearings["UJB"], centre_x_um=60.0 + elapsed_s)
        bearings = {**quiet.bearings, "UJB": upper}
        return replace(quiet, bearings=bearings, unbalance_grade_mm_s=2.0 + 0.05 * elapsed_s)

    seen = readings(SimulatedPlant(machine, Told(moved), 3), 8)[SHAFT]
    still = readings(SimulatedPlant(machine, quiet, 3), 8)[SHAFT]
    mean_um = seen.reshape(8, -1).mean(axis=1)

    assert np.diff(mean_um[1:]) == pytest.approx(-CHUNK_S, abs=1.0)
    assert np.max(np.abs(np.diff(seen))) < 1.5 * np.max(np.abs(np.diff(still)))


def test_a_shaft_that_comes_to_rest_shakes_nothing(machine, full_load):
    def stopping(elapsed_s: float) -> Scenario:
        share = max(1.0 - elapsed_s / 30.0, 0.0)
        hydraulic = replace(full_load.hydraulic, rms_n=share**2 * full_load.hydraulic.rms_n)
        return replace(full_load, speed_rpm=92.3 * share, hydraulic=hydraulic)

    plant = SimulatedPlant(machine, Told(stopping), 3)
    running, *_, standing = [plant.advance() for _ in range(24)]

    assert plant.speed_rpm(standing, 0) == 0.0
    noise = full_load.noise
    assert np.std(running.readings[SHAFT]) > 10.0 * noise.gap_um_rms
    assert np.std(standing.readings[SHAFT]) == pytest.approx(noise.gap_um_rms, rel=0.1)
    assert np.std(standing.readings[BEARING]) == pytest.approx(noise.velocity_mm_s_rms, rel=0.1)
