"""Units whose scenario changes while they run: nothing jumps that does not jump in a machine."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.signal

from acquisition.simulated.plant import CHUNK_SAMPLES, SimulatedPlant
from acquisition.simulated.scenario import Scenario
from core.arrays import FloatArray
from core.film import Film
from core.machine import Unit

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


def test_a_course_that_stands_still_is_a_scenario(machine: Unit, quiet: Scenario) -> None:
    steady, course = (SimulatedPlant(machine, s, 3) for s in (quiet, Told(lambda _: quiet)))
    assert readings(course, 4) == pytest.approx(readings(steady, 4), abs=1e-9)


def test_a_film_that_softens_within_a_minute_leaves_no_click(
    machine: Unit, quiet: Scenario
) -> None:
    course = Told(lambda s: softened(quiet, 0.2 * min(max(s - 7.0, 0.0) / 60.0, 1.0)))
    seen = readings(SimulatedPlant(machine, course, 3), 24)[BEARING]
    before, after = (np.ptp(seen[part]) for part in (slice(0, 3000), slice(-3000, None)))

    assert abs(after / before - 1.0) > 0.02  # the film did soften
    high = scipy.signal.sosfiltfilt(
        scipy.signal.butter(4, 60.0, "highpass", fs=RATE_HZ, output="sos"), seen
    )
    assert np.max(np.abs(high[600:-600])) < 1e-3 * before


def test_a_shaft_that_moves_over_and_a_load_that_rises_leave_no_step(
    machine: Unit, quiet: Scenario
) -> None:
    def moved(elapsed_s: float) -> Scenario:
        upper = replace(quiet.bearings["UJB"], centre_x_um=60.0 + elapsed_s)
        bearings = {**quiet.bearings, "UJB": upper}
        return replace(quiet, bearings=bearings, unbalance_grade_mm_s=2.0 + 0.05 * elapsed_s)

    seen = readings(SimulatedPlant(machine, Told(moved), 3), 8)[SHAFT]
    still = readings(SimulatedPlant(machine, quiet, 3), 8)[SHAFT]
    mean_um = seen.reshape(8, -1).mean(axis=1)

    assert np.diff(mean_um[1:]) == pytest.approx(-CHUNK_S, abs=1.0)
    assert np.max(np.abs(np.diff(seen))) < 1.5 * np.max(np.abs(np.diff(still)))


def test_a_shaft_that_comes_to_rest_shakes_nothing(machine: Unit, full_load: Scenario) -> None:
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
