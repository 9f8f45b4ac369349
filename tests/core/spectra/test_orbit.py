"""The path of a shaft: known ellipses come back, and the way they turn is told."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.arrays import ComplexArray, FloatArray
from core.spectra.cross_spectrum import CrossSpectrum, average, roundness, shared_power
from core.spectra.lines import peak_frequency_hz
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
def test_an_ellipse_comes_back_with_axes_angle_and_sense(major, roundness, angle_deg, sense):
    x, y = on_ellipse(major, roundness * major, angle_deg, sense)

    phasors = [order_phasors(each, RATE_HZ, TURN_HZ)[MIDDLE] for each in (x, y)]
    found = ellipse_of(*(complex(each) for each in phasors))

    assert found.major_um_pk == pytest.approx(major, rel=1e-4)
    assert found.minor_um_pk == pytest.approx(roundness * major, rel=2e-3, abs=1e-3 * major)
    assert found.sense == sense
    off_deg = (found.angle_deg - angle_deg + 90.0) % 180.0 - 90.0
    assert abs(off_deg) < 0.2 / (1.0 - roundness)


def test_a_straight_line_has_no_sense():
    found = ellipse_of(3.0 + 0.0j, 4.0 + 0.0j)

    assert (found.major_um_pk, found.minor_um_pk, found.sense) == pytest.approx((5.0, 0.0, 0))
    assert found.angle_deg == pytest.approx(math.degrees(math.atan2(4.0, 3.0)))


def test_running_speed_alone_is_left_of_a_motion_with_vortex_harmonic_and_noise():
    x, _ = on_ellipse(60.0, 40.0, 20.0, 1)
    random = np.random.default_rng(1)
    disturbed = x + 80.0 * np.sin(2.0 * np.pi * 0.25 * TURN_HZ * T)
    disturbed += 20.0 * np.sin(2.0 * np.pi * 2.0 * TURN_HZ * T) + random.normal(0.0, 5.0, T.size)

    alone = trace_of(order_phasors(disturbed, RATE_HZ, TURN_HZ), RATE_HZ, TURN_HZ)

    inner = slice(round(3.0 * RATE_HZ), -round(3.0 * RATE_HZ))
    assert np.max(np.abs(alone[inner] - x[inner])) < 1.5


def test_a_motion_that_grows_is_followed_across_short_holes_and_not_across_long_ones():
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


def pulses(turns: FloatArray) -> FloatArray:
    """Five volts while the mark passes, a fiftieth of a turn."""
    return np.where(turns % 1.0 < 0.02, 5.0, 0.0)


def test_marks_lie_where_the_pulses_begin_also_before_and_behind_a_hole():
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


FREQUENCY_HZ = 0.0732421875 * np.arange(1, 41)


def spectrum(phasors: ComplexArray) -> CrossSpectrum:
    return average(FREQUENCY_HZ, phasors, np.ones(phasors.shape[:2], dtype=bool))


def noise(seed: int, n_segments: int = 24) -> ComplexArray:
    rng = np.random.default_rng(seed)
    shape = (n_segments, 4, FREQUENCY_HZ.size)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def orbit(x: complex, y: complex, n_segments: int = 24) -> CrossSpectrum:
    phasors = np.zeros((n_segments, 4, FREQUENCY_HZ.size), dtype=np.complex128)
    phasors[:, 0], phasors[:, 1] = x, y
    return spectrum(phasors)


def test_x_before_y_is_forward_and_a_straight_line_has_no_sense():
    assert roundness(orbit(2.0, -2.0j), 3) == pytest.approx(1.0)
    assert roundness(orbit(2.0, 2.0j), 3) == pytest.approx(-1.0)
    assert roundness(orbit(-1.0j, 1.0), 3) == pytest.approx(-1.0)  # exchanged
    assert roundness(orbit(1.0, 2.0), 3) == 0.0
    assert roundness(orbit(0.0, 0.0), 3) == 0.0
    chance = [roundness(spectrum(noise(seed)), 3) for seed in range(200)]
    assert np.std(chance) == pytest.approx(np.sqrt(1.0 / 48.0), rel=0.2)


def with_line(phasors: ComplexArray, line: int, size: float, rows: slice) -> ComplexArray:
    """Add a Hann-shaped line around a bin, common to some channels and random in phase."""
    phase = np.exp(2j * np.pi * np.random.default_rng(9).uniform(size=(phasors.shape[0], 1)))
    changed = phasors.copy()
    for offset, share in ((-1, -0.5), (0, 1.0), (1, -0.5)):
        changed[:, rows, line + offset] += share * size * phase
    return changed


def vortex_hz(spectra: list[CrossSpectrum], band_hz: tuple[float, float]) -> float | None:
    """Frequency of the strongest shared line in a band."""
    return peak_frequency_hz(shared_power(spectra), spectra[0].frequency_hz, band_hz)


def test_a_vortex_is_a_shared_line_and_neither_a_flank_nor_nothing():
    shared = with_line(noise(1), 5, 10.0, slice(None))
    louder_in_one_probe = with_line(shared, 8, 30.0, slice(0, 1))
    silent, moving = noise(1), with_line(noise(2), 6, 10.0, slice(None))

    for line, bearings in ((5, [louder_in_one_probe]), (6, [silent, moving])):
        found = vortex_hz([spectrum(phasors) for phasors in bearings], (0.3, 0.7))
        assert found == pytest.approx(FREQUENCY_HZ[line], abs=0.3 * FREQUENCY_HZ[0])

    beyond = with_line(1e-3 * noise(1), 12, 10.0, slice(None))
    assert vortex_hz([spectrum(beyond)], (0.6, 0.89)) is None
    assert vortex_hz([orbit(0.0, 0.0)], (5.0, 6.0)) is None
