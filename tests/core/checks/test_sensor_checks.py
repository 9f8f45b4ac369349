"""What a record says about its transducers and its operation."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from core.checks.sensor_checks import (
    SensorLimits,
    axes_quality,
    backward_share,
    checked_speed,
    clipped_share,
    level_quality,
    quietest_rms,
    signal_quality,
    stationarity,
)
from core.quality import GOOD, Quality, Reading, Reason, bad, missing, uncertain

LIMITS = SensorLimits()
RANDOM = np.random.default_rng(5)
MM_S_PER_COUNT = 10.0 / 32768
N_SAMPLES = 8192


def judged(samples: npt.NDArray[np.floating], turning: bool = True) -> Quality:
    counts = np.rint(samples / MM_S_PER_COUNT) * MM_S_PER_COUNT
    rms = float(quietest_rms(counts[np.newaxis])[0])
    return signal_quality(rms, float(counts.mean()), MM_S_PER_COUNT, turning, LIMITS)


def test_of_eight_samples_or_more_a_healthy_channel_moves_by_more_than_a_count():
    time_s = np.arange(N_SAMPLES) / 600.0
    assert judged(0.002 * np.sin(2 * np.pi * 1.538 * time_s)) == GOOD
    assert judged(0.001 * RANDOM.standard_normal(N_SAMPLES)) == GOOD
    flicker = MM_S_PER_COUNT * RANDOM.integers(-1, 2, N_SAMPLES)
    assert judged(flicker + 0.5) == bad(Reason.STUCK)
    assert judged(flicker) == bad(Reason.DEAD)
    assert judged(np.zeros(N_SAMPLES)) == bad(Reason.DEAD)
    assert judged(flicker + 0.5, turning=False) == GOOD


@pytest.mark.parametrize("from_sample", [1000, 4000, 7168])
def test_a_channel_that_stops_within_a_segment_is_seen_in_that_segment(from_sample):
    signal = 0.1 * RANDOM.standard_normal(N_SAMPLES)
    signal[from_sample:] = signal[from_sample]
    assert judged(signal).reason is not Reason.OK


@pytest.mark.parametrize(
    ("rms", "mean", "per_count", "quality"),
    [
        (0.0, 5.0, 0.0, bad(Reason.STUCK)),
        (0.0, 0.0, 0.0, bad(Reason.DEAD)),
        (1e-9, 5.0, 0.0, GOOD),
        (0.1, 1900.0, -0.15, bad(Reason.STUCK)),
        (0.2, 1900.0, -0.15, GOOD),
    ],
)
def test_a_resolution_may_be_unknown_or_negative(rms, mean, per_count, quality):
    assert signal_quality(rms, mean, per_count, True, LIMITS) == quality


TURNS = np.arange(N_SAMPLES) / 390.0
NEAR = 2180.0 + 100.0 * np.sin(2 * np.pi * TURNS)  # up to 2280 µm, where the limit is 2250


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        (NEAR, GOOD),
        (NEAR + 80.0, bad(Reason.SENSOR_FAILURE)),
        (np.where(np.abs(TURNS - 10.2) < 0.15, 0.0, NEAR), bad(Reason.SENSOR_FAILURE)),
        (np.where(TURNS > 20.0, 2500.0, NEAR), bad(Reason.SENSOR_FAILURE)),
        (NEAR[:200], GOOD),
    ],
    ids=["vibrates near a limit", "beyond it", "loses contact", "fails at the end", "half a turn"],
)
def test_ok_limits_are_of_the_level_and_not_of_the_vibration(samples, expected):
    assert level_quality(samples, 390, (-2250.0, 2250.0)) == expected


def test_the_share_of_clipped_samples_is_counted_at_both_ends():
    counts = np.array([0.0, 32767.0, -32768.0, -32767.0, 32766.0])
    assert clipped_share(0.15 * counts, 0.15) == 0.4
    assert clipped_share(-0.15 * counts, -0.15) == 0.4


def share(x: complex, y: complex) -> float:
    return backward_share(abs(x) ** 2, abs(y) ** 2, x * y.conjugate())


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [(1, -1j, 0.0), (1, 1j, 1.0), (1, 1, 0.5), (1, 0, 0.5), (0, 0, 0.5), (2, -1j, 0.1)],
)
def test_the_share_of_an_orbit_that_turns_backward(x, y, expected):
    turned = np.exp(0.7j)
    assert share(x, y) == pytest.approx(expected)
    assert share(x * turned, y * turned) == pytest.approx(expected)


def test_swapped_axes_turn_an_orbit_against_the_shaft():
    forward, swapped = share(2, -1j), share(-1j, 2)
    assert axes_quality(forward, 1, LIMITS) == GOOD
    assert axes_quality(swapped, 1, LIMITS) == uncertain(Reason.SWAPPED_AXES)
    assert axes_quality(swapped, -1, LIMITS) == GOOD
    assert axes_quality(forward, -1, LIMITS) == uncertain(Reason.SWAPPED_AXES)
    assert axes_quality(share(1, 0.2), 1, LIMITS) == GOOD


def test_a_speed_no_turbine_reaches_is_none_and_one_that_the_1x_line_contradicts_in_doubt():
    for speed_rpm in (-5.0, 300.0, 65535.0):
        checked = checked_speed(Reading(speed_rpm), None, 92.3, LIMITS)
        assert checked == missing(Reason.SPEED_IMPLAUSIBLE)
    told = Reading(92.3)
    assert checked_speed(told, 92.2, 92.3, LIMITS) == told
    assert checked_speed(told, 92.0, 92.3, LIMITS) != told
    assert checked_speed(told, 92.0, 92.3, LIMITS, u_line=0.001) == told
    assert checked_speed(told, None, 92.3, LIMITS) == told
    doubted = checked_speed(told, 88.0, 92.3, LIMITS)
    assert doubted == Reading(92.3, uncertain(Reason.SPEED_IMPLAUSIBLE))
    nothing = missing(Reason.NOT_MEASURED)
    assert checked_speed(nothing, 92.3, 92.3, LIMITS) == nothing


STILL = np.full(24, 92.3)
FULL = np.full(24, 700.0)


def test_ordinary_wander_is_stationary_and_a_load_change_or_a_run_down_is_not():
    swing = np.sin(np.arange(24.0))
    assert stationarity(92.3 * (1 + 0.003 * swing), FULL + 8 * swing, LIMITS) == GOOD
    assert stationarity(STILL, 2.0 * swing, LIMITS, 700.0) == GOOD
    assert stationarity(np.array([]), np.array([]), LIMITS) == GOOD
    moved = uncertain(Reason.NON_STATIONARY)
    assert stationarity(STILL, np.linspace(320.0, 400.0, 24), LIMITS) == moved
    assert stationarity(np.linspace(92.3, 80.0, 24), FULL, LIMITS) == moved
    some = np.array([math.nan, 700.0, 500.0])
    assert stationarity(STILL, some, LIMITS) == moved


def test_a_load_change_is_a_share_of_the_rated_power_and_an_unknown_load_is_not_steady():
    """Two thirds of a 15 MW unit's power are 10 MW."""
    moved, unknown = uncertain(Reason.NON_STATIONARY), uncertain(Reason.POWER_UNKNOWN)
    small = np.linspace(15.0, 5.0, 24)
    assert stationarity(STILL, small, LIMITS, 15.0) == moved
    assert stationarity(STILL, small / 20.0, LIMITS, 15.0) == GOOD
    stricter = replace(LIMITS, max_power_change=0.03)
    assert stationarity(STILL, small / 20.0, stricter, 15.0) == moved
    lost = np.where(np.arange(24) < 20, 700.0, math.nan)
    assert stationarity(STILL, lost, LIMITS, 700.0) == unknown
    assert stationarity(STILL, np.full(24, math.nan), LIMITS, 700.0) == unknown
    assert stationarity(STILL, lost[::-1], LIMITS, 700.0) == GOOD
