"""The path of a shaft: known ellipses come back, and what is missing stays missing."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.arrays import FloatArray
from core.spectra.orbit import ellipse_of, marks_of, order_phasors, trace_of

RATE_HZ, TURN_HZ = 600.0, 92.3 / 60.0
T = np.arange(round(20.0 * RATE_HZ)) / RATE_HZ
MIDDLE = T.size // 2


def on_ellipse(
    major: float, minor: float, angle_deg: float, sense: int
) -> tuple[FloatArray, FloatArray]:
    """Motion along x and y at running speed, from the definition of an ellipse."""
    turn = 2.0 * math.pi * TURN_HZ * T + 0.7
    along, across = major * np.cos(turn), sense * minor * np.sin(turn)
    angle = math.radians(angle_deg)
    return (
        along * math.cos(angle) - across * math.sin(angle),
        along * math.sin(angle) + across * math.cos(angle),
    )


@given(
    major=st.floats(1.0, 500.0),
    roundness=st.floats(0.05, 0.95),
    angle_deg=st.floats(-89.0, 89.0),
    sense=st.sampled_from([-1, 1]),
)
def test_an_ellipse_comes_back_with_its_axes_its_angle_and_its_sense(
    major: float, roundness: float, angle_deg: float, sense: int
) -> None:
    x, y = on_ellipse(major, roundness * major, angle_deg, sense)

    phasors = [order_phasors(each, RATE_HZ, TURN_HZ)[MIDDLE] for each in (x, y)]
    found = ellipse_of(*(complex(each) for each in phasors))

    assert found.major_um_pk == pytest.approx(major, rel=1e-4)
    assert found.minor_um_pk == pytest.approx(roundness * major, rel=2e-3, abs=1e-3 * major)
    assert found.sense == sense
    off_deg = (found.angle_deg - angle_deg + 90.0) % 180.0 - 90.0
    assert abs(off_deg) < 0.2 / (1.0 - roundness)


def test_a_straight_line_has_no_sense() -> None:
    found = ellipse_of(3.0 + 0.0j, 4.0 + 0.0j)

    assert (found.major_um_pk, found.minor_um_pk, found.sense) == pytest.approx((5.0, 0.0, 0))
    assert found.angle_deg == pytest.approx(math.degrees(math.atan2(4.0, 3.0)))


def test_running_speed_alone_is_left_of_a_motion_with_vortex_harmonic_and_noise() -> None:
    x, _ = on_ellipse(60.0, 40.0, 20.0, 1)
    random = np.random.default_rng(1)
    disturbed = x + 80.0 * np.sin(2.0 * np.pi * 0.25 * TURN_HZ * T)
    disturbed += 20.0 * np.sin(2.0 * np.pi * 2.0 * TURN_HZ * T) + random.normal(0.0, 5.0, T.size)

    alone = trace_of(order_phasors(disturbed, RATE_HZ, TURN_HZ), RATE_HZ, TURN_HZ)

    inner = slice(round(3.0 * RATE_HZ), -round(3.0 * RATE_HZ))
    assert np.max(np.abs(alone[inner] - x[inner])) < 1.5


def test_a_motion_that_grows_is_followed_across_short_holes_and_not_across_long_ones() -> None:
    x, _ = on_ellipse(60.0, 40.0, 0.0, 1)

    size = np.abs(order_phasors(x * np.linspace(0.5, 1.5, T.size), RATE_HZ, TURN_HZ))

    at = [T.size // 4, MIDDLE, 3 * T.size // 4]
    assert size[at] == pytest.approx([45.0, 60.0, 75.0], rel=0.01)

    x, _ = on_ellipse(60.0, 40.0, 0.0, 1)
    x[3000:3100] = np.nan
    x[6000:11000] = np.nan

    size = np.abs(order_phasors(x, RATE_HZ, TURN_HZ))

    assert size[3050] == pytest.approx(60.0, rel=0.03)
    assert np.isnan(size[8500])
    assert np.isnan(order_phasors(np.full(5000, np.nan), RATE_HZ, TURN_HZ)).all()


@pytest.mark.parametrize("frequency_hz", [0.0, -1.0, 300.0, 1e9])
def test_a_frequency_that_cannot_be_read_is_refused_with_the_limit(frequency_hz: float) -> None:
    with pytest.raises(ValueError, match="within 0 and 300 Hz"):
        order_phasors(np.zeros(100), RATE_HZ, frequency_hz)


def pulses(turns: FloatArray) -> FloatArray:
    """Five volts while the mark passes, a fiftieth of a turn."""
    return np.where(turns % 1.0 < 0.02, 5.0, 0.0)


def test_marks_lie_where_the_pulses_begin_also_before_and_behind_a_hole() -> None:
    marks = marks_of(pulses(TURN_HZ * T + 0.25))

    expected = (np.arange(1, marks.size + 1) - 0.25) / TURN_HZ * RATE_HZ
    assert marks.size == 31
    assert np.max(np.abs(marks - expected)) <= 1.0

    noise = np.random.default_rng(2).normal(0.0, 0.01, T.size)

    assert marks_of(noise).size == 0
    assert marks_of(np.full(100, np.nan)).size == 0
    assert marks_of(np.zeros(100)).size == 0

    signal = pulses(TURN_HZ * T + 0.25)
    whole = marks_of(signal)
    signal[4000:5000] = np.nan

    left = marks_of(signal)

    assert left.tolist() == [at for at in whole if not 3999.0 < at < 5000.0]
