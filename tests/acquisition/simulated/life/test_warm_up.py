"""The warm-ups that Brito et al. measured: Tables 8 and 9, at speed without load.

Only X of the second day was fitted to (see `life_bearing` and `excitation`), and at the UJB a shift
of the shaft is put in after 6.7 h, as the paper's third process. The oil's temperatures were not
published: 33 °C cold and 46 °C warm lie in what their Table 1 and the season allow.
"""

from functools import cache

import numpy as np
import pytest

from acquisition.simulated.life.bearing import LIFE_BEARINGS, LifeBearing, thermal_course
from acquisition.simulated.life.excitation import order1_um_pk, warm_unbalance
from acquisition.simulated.life.films import PadSetting, film_course
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.plant.rotor import RotorParameters
from core.arrays import FloatArray

N_MINUTES = 421
HOURS = np.arange(N_MINUTES) / 60.0
GRADE_MM_S = 4.25
K_EFF = 1.0073
"""|k + iΩc| over k at 92.3 r/min."""


@cache
def second_day() -> tuple[dict[str, FloatArray], dict[str, FloatArray], dict[str, FloatArray]]:
    """k_eff in GN/m (2, n), mean clearance in µm, amplitudes u_x, u_y, x_b, y_b in µm."""
    minute_ns = 60_000_000_000
    operation = Operation(
        np.arange(N_MINUTES, dtype=np.int64) * minute_ns,
        np.full(N_MINUTES, 92.3),
        np.zeros(N_MINUTES),
        92.3,
    )
    films, k_eff, clearance_um = {}, {}, {}
    for bearing in LIFE_BEARINGS:
        thermal = thermal_course(bearing, operation, np.full(N_MINUTES, 24.0), initial_oil_c=33.0)
        even = PadSetting(np.full(bearing.ring.n_pads, bearing.cold_clearance_um))
        course = film_course(bearing, even, thermal, operation.speed_rpm, _position_um(bearing))
        films[bearing.id], clearance_um[bearing.id] = course.film, course.clearance_um
        k = np.stack([course.film.k_xx_n_per_m, course.film.k_yy_n_per_m])
        k_eff[bearing.id] = K_EFF * k / 1e9
    grade_mm_s = 1.04 * GRADE_MM_S * warm_unbalance(operation)
    sound = {bearing.id: np.ones(N_MINUTES) for bearing in LIFE_BEARINGS}
    phasors = order1_um_pk(films, sound, 92.3, grade_mm_s, RotorParameters())
    return k_eff, clearance_um, {name: np.abs(p) for name, p in phasors.items()}


def _position_um(bearing: LifeBearing) -> FloatArray:
    has_shifted = (HOURS >= 6.7) & (bearing.id == "UJB")
    ratio = np.where(has_shifted, 0.32, 0.15)
    return bearing.configured_clearance_um * np.stack([ratio, np.zeros(N_MINUTES)])


def at(hour: float) -> int:
    return round(60.0 * hour)


@pytest.mark.parametrize(
    ("bearing", "hour", "k_eff"),
    [
        *(("UJB", *row) for row in [(0.0, 0.37), (5.5, 0.47), (6.5, 0.49), (7.0, 0.69)]),
        *(("LJB", *row) for row in [(0.0, 0.31), (6.5, 0.37), (7.0, 0.37)]),
    ],
)
def test_bearings_stiffen_as_in_tables_8_and_9(bearing, hour, k_eff):
    # two figures are printed; 5 % holds them all
    # 0.26 GN/m at 5.5 h, between 0.31 and 0.37, is left out: bearing motion was 5.6 µm there
    assert second_day()[0][bearing][0, at(hour)] == pytest.approx(k_eff, rel=0.05)


@pytest.mark.parametrize(
    ("bearing", "row", "cold_um_pk", "warm_um_pk", "within"),
    [
        ("UJB", 0, 89.0, 40.0, 0.05),  # shaft X of the UJB falls to less than half
        ("UJB", 1, 99.0, 51.0, 0.333),
        ("UJB", 2, 28.0, 24.0, 0.333),
        ("LJB", 0, 68.0, 38.0, 0.333),
        ("LJB", 1, 74.0, 41.0, 0.333),
        ("LJB", 2, 9.6, 6.5, 0.333),
    ],
)
def test_motion_falls_as_measured_and_what_was_not_fitted_comes_out_within_a_third(
    bearing, row, cold_um_pk, warm_um_pk, within
):
    # shaft Y and bearing X of both bearings, from one unbalance and the paper's rotor
    amplitude = second_day()[2][bearing][row]

    assert amplitude[at(0.0)] == pytest.approx(cold_um_pk, rel=within)
    assert amplitude[at(7.0)] == pytest.approx(warm_um_pk, rel=within)


def test_stiffness_first_rests_then_rises_as_on_all_three_days():
    # day 1: 0.44, after half an hour 0.42; day 3: 0.18, after 1 h 0.19, after 6.5 h 0.26
    k = second_day()[0]["UJB"][0] / second_day()[0]["UJB"][0, 0]

    assert k[at(0.5)] == pytest.approx(0.42 / 0.44, rel=0.05)
    assert k[at(1.0)] == pytest.approx(0.19 / 0.18, rel=0.05)
    assert k[at(6.5)] == pytest.approx(0.26 / 0.18, rel=0.1)


@pytest.mark.parametrize(
    ("bearing", "shrinks_um"), [("UJB", (119.0, 179.0)), ("LJB", (161.0, 278.0))]
)
def test_clearance_closes_about_as_much_as_the_gaps_did(bearing, shrinks_um):
    # gaps of both probes on days 2 and 3 after 5.5 to 7 h; they hold shaft motion as well
    clearance_um = second_day()[1][bearing]

    least, most = shrinks_um
    assert least <= clearance_um[0] - clearance_um[at(7.0)] <= most
