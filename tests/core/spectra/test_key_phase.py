"""A key-phase gives angle and speed when every pulse is where it belongs, or neither."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.arrays import FloatArray
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.quality import Level, Reading, Reason, bad, missing
from core.spectra.speed import (
    KeyPhase,
    Speed,
    SpeedSource,
    read_key_phase,
    rising_edges,
    running_speed,
)

RATE_HZ = 600.0
N_SAMPLES = 8192
WIDTH_TURNS = 6.0 / 360.0


def turned(speed_rpm: float, angle_rad: float) -> FloatArray:
    turns: FloatArray = speed_rpm / 60 / RATE_HZ * np.arange(N_SAMPLES, dtype=np.float64)
    return turns + angle_rad / (2 * math.pi)


def steps(speed_rpm: float, angle_rad: float) -> FloatArray:
    """Pulses of 5 V with edges that a sample tells no more of than on which side it is."""
    return np.where(turned(speed_rpm, angle_rad) % 1.0 < WIDTH_TURNS, 5.0, 0.2)


def pulses(speed_rpm: float, angle_rad: float) -> FloatArray:
    """The same, averaged over each sampling interval as a converter does."""
    step = speed_rpm / 60 / RATE_HZ
    edges = turned(speed_rpm, angle_rad)[:, np.newaxis] + step * np.array([-0.5, 0.5])
    so_far = np.floor(edges) * WIDTH_TURNS + np.minimum(edges % 1.0, WIDTH_TURNS)
    return 0.2 + 4.8 * np.diff(so_far, axis=1)[:, 0] / step


def angle_error_deg(found: KeyPhase, angle_rad: float) -> float:
    return math.degrees(
        (found.shaft_angle_rad - angle_rad + math.pi) % (2 * math.pi) - math.pi,
    )


def edges_of(signal: FloatArray) -> list[int]:
    return [math.ceil(edge) for edge in rising_edges(signal)]


@pytest.mark.parametrize("speed_rpm", [60.0, 76.6, 92.3, 90.909, 120.0, 143.7, 150.0])
@pytest.mark.parametrize("angle_rad", [0.0, 0.9, 3.3, 6.2])
def test_clean_pulses_give_angle_and_speed(speed_rpm, angle_rad):
    found = read_key_phase(pulses(speed_rpm, angle_rad), RATE_HZ)

    assert isinstance(found, KeyPhase)
    assert abs(angle_error_deg(found, angle_rad)) < 0.2
    assert found.speed_rpm == pytest.approx(speed_rpm, rel=5e-5)
    assert 0.0 <= found.shaft_angle_rad < 2 * math.pi


@pytest.mark.parametrize("speed_rpm", np.linspace(60.0, 150.0, 91).tolist())
def test_edges_without_slope_still_give_angle_and_speed(speed_rpm):
    found = read_key_phase(steps(speed_rpm, 0.9), RATE_HZ)

    assert isinstance(found, KeyPhase)
    # where a turn is a whole number of samples, all edges are late alike, by half a sample at most
    assert abs(angle_error_deg(found, 0.9)) < 1.0
    assert found.speed_rpm == pytest.approx(speed_rpm, rel=1.5e-4)


def test_edges_lie_between_the_samples_and_are_exact_where_they_slope():
    ramp = np.array([0.0, 0.0, 0.1, 0.7, 1.0, 1.0, 0.0, 0.0, 0.3, 0.9, 1.0, 0.0])
    assert rising_edges(ramp) == pytest.approx([2 + 2 / 3, 8 + 1 / 3])
    # behind an anti-alias filter an edge takes a few samples
    turns = turned(92.3, 0.6 * math.pi)
    sloped = np.interp(turns % 1.0, [0.0, 0.01, 0.03, 0.04, 0.99, 1.0], [2.5, 5, 5, 0, 0, 2.5])
    found = read_key_phase(sloped, RATE_HZ)
    assert isinstance(found, KeyPhase)
    assert abs(angle_error_deg(found, 0.6 * math.pi)) < 0.001
    assert found.speed_rpm == pytest.approx(92.3, rel=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_noise_makes_no_pulses_and_hardly_moves_the_angle(seed):
    noise = 0.1 * np.random.default_rng(seed).normal(size=N_SAMPLES)
    found = read_key_phase(pulses(92.3, 1.0) + noise, RATE_HZ)
    assert isinstance(found, KeyPhase)
    assert abs(angle_error_deg(found, 1.0)) < 1.0
    assert found.speed_rpm == pytest.approx(92.3, rel=1e-4)


def test_a_missing_pulse_or_a_pick_up_that_fails_is_no_phase_reference():
    begins = np.array(edges_of(pulses(92.3, 0.9)))[[0, 1, 9, 19, 20]]
    single = [slice(begin - 1, begin + 12) for begin in begins]
    for dead in (*single, slice(0, N_SAMPLES // 2), slice(N_SAMPLES // 2, None)):
        signal = pulses(92.3, 0.9)
        signal[dead] = 0.2
        assert read_key_phase(signal, RATE_HZ) is None, dead


@pytest.mark.parametrize(
    ("first", "last"), [(-20, 0), *((after, after + 6) for after in (20, 80, 200, 350))]
)
def test_a_pulse_out_of_its_place_is_no_phase_reference(first, last):
    signal = pulses(92.3, 0.9)
    begin = edges_of(signal)[7]
    signal[begin + first : begin + last] = 5.0
    assert read_key_phase(signal, RATE_HZ) is None


def test_doubled_pulses_and_fast_changes_of_speed_are_no_phase_reference():
    turns = 92.3 / 60 / RATE_HZ * np.arange(N_SAMPLES)
    twice = (turns % 1.0 < WIDTH_TURNS) | ((turns - 0.3) % 1.0 < WIDTH_TURNS)
    fault = read_key_phase(np.where(twice, 5.0, 0.0), RATE_HZ)
    assert fault is None
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    running_up = 0.5 + 92.3 / 60 * time_s + 0.004 * time_s**2
    found = read_key_phase(np.where(running_up % 1.0 < WIDTH_TURNS, 5.0, 0.0), RATE_HZ)
    assert found is None


@pytest.mark.parametrize("seed", range(20))
def test_without_pulses_noise_is_never_read_as_any(seed):
    noise = np.random.default_rng(seed).normal(size=N_SAMPLES)
    assert read_key_phase(noise, RATE_HZ) is None


@pytest.mark.parametrize(
    "signal", [*(np.full(N_SAMPLES, level_v) for level_v in (0.0, 0.2, 5.0)), pulses(8.0, 0.9)]
)
def test_a_shaft_that_stands_or_rolls_slowly_has_too_few_pulses(signal):
    assert read_key_phase(signal, RATE_HZ) is None


FREQUENCY_HZ = np.arange(1, 300) * 600.0 / 8192
NO_LINE = np.ones(FREQUENCY_HZ.size)


def speed(unit: Unit, slow: Reading, pulses_rpm: float | None) -> Speed:
    key_phase = None if pulses_rpm is None else KeyPhase(1.0, pulses_rpm, 1e-5, 20)
    with_pulses = replace(unit, key_phase="kp")
    settings = AnalysisSettings()
    return running_speed(with_pulses, {"speed": slow}, FREQUENCY_HZ, NO_LINE, settings, key_phase)


@pytest.mark.parametrize("slow", [Reading(92.2), missing(Reason.OUT_OF_RANGE)])
def test_good_pulses_are_preferred(unit, slow):
    found = speed(unit, slow, 92.3)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm == Reading(92.3)


@pytest.mark.parametrize("pulses_rpm", [None, 400.0], ids=["none", "no turbine reaches"])
def test_without_good_pulses_the_speed_channel_counts(unit, pulses_rpm):
    found = speed(unit, Reading(92.2), pulses_rpm)
    assert found.source is SpeedSource.SLOW_CHANNEL
    assert found.rpm == Reading(92.2)
    assert found.budget.systematic == pytest.approx(0.02 * 92.2 / np.sqrt(3.0))


@pytest.mark.parametrize("pulses_rpm", [184.6, 80.0])
def test_pulses_that_the_speed_channel_contradicts_are_doubted(unit, pulses_rpm):
    found = speed(unit, Reading(92.3), pulses_rpm)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm.quality.level is Level.UNCERTAIN
    assert found.rpm.quality.reason is Reason.SPEED_IMPLAUSIBLE
    assert found.budget is None


def test_pulses_far_below_the_rated_speed_are_standstill(unit):
    found = speed(unit, missing(Reason.OUT_OF_RANGE), 15.0)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm.quality == bad(Reason.STANDSTILL)


def test_the_interval_of_a_speed_by_pulses_holds_the_truth(unit):
    held = []
    for seed in range(200):
        noisy = pulses(92.3, 0.9) + np.random.default_rng(seed).normal(0.0, 0.3, N_SAMPLES)
        key_phase = read_key_phase(noisy, RATE_HZ)
        slow, settings = {"speed": missing(Reason.OUT_OF_RANGE)}, AnalysisSettings()
        found = running_speed(unit, slow, FREQUENCY_HZ, NO_LINE, settings, key_phase)
        low, high = found.budget.interval
        assert high - low < 0.02
        held.append(low <= 92.3 <= high)
    assert np.mean(held) > 0.93


@pytest.mark.parametrize("slow", [Reading(92.3), missing(Reason.OUT_OF_RANGE)])
def test_the_speed_of_a_line_is_as_uncertain_as_the_line_is_weak(unit, slow):
    bins = (FREQUENCY_HZ - 92.3 / 60.0) * 8192 / 600.0
    power = NO_LINE + 1e4 * (np.sinc(bins) / (1.0 - bins**2)) ** 2  # Hann's main lobe
    found = running_speed(unit, {"speed": slow}, FREQUENCY_HZ, power, AnalysisSettings())
    budget = found.budget
    if slow.value is None:
        assert found.source is SpeedSource.LINE
        assert (budget.random, budget.systematic) == (pytest.approx(0.016, rel=0.1), 0.0)
    else:  # as well as it agrees with the line
        assert budget.systematic == pytest.approx(92.3 * 0.002 / np.sqrt(3.0), rel=0.1)
