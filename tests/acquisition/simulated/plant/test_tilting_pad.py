"""Laws of a ring of pivoted pads and of its oil."""

import numpy as np
import pytest

from acquisition.simulated.plant.films import FilmColumns, Oil, PadRing
from core.arrays import FloatArray

RING = PadRing(16, 6.67e9, 200.0, 0.034, 92.3, first_pad_deg=11.25)
MANY = PadRing(360, 6.67e9, 200.0, 0.034, 92.3)
DESIGN = {"clearance_um": 200.0, "viscosity_pa_s": 0.034, "speed_rpm": 92.3}


def film(
    ring: PadRing, ratio: float = 0.0, angle_deg: float = 0.0, **changed: float
) -> FilmColumns:
    given = DESIGN | changed
    angle = np.radians(angle_deg)
    centre_um = ratio * given["clearance_um"] * np.array([[np.cos(angle)], [np.sin(angle)]])
    return ring.film(
        np.full((ring.n_pads, 1), given["clearance_um"]),
        centre_um,
        np.array([given["viscosity_pa_s"]]),
        np.array([given["speed_rpm"]]),
    )


def k_xx(ring: PadRing, ratio: float = 0.0, angle_deg: float = 0.0, **changed: float) -> float:
    return float(film(ring, ratio, angle_deg, **changed).k_xx_n_per_m[0])


def test_a_centred_shaft_meets_the_design_stiffness_which_grows_with_eccentricity():
    centred = film(RING)

    assert centred.k_xx_n_per_m[0] == pytest.approx(6.67e9)
    assert centred.k_yy_n_per_m[0] == pytest.approx(6.67e9)
    assert abs(centred.k_xy_n_per_m[0]) < 1.0

    along = np.array([k_xx(RING, ratio) for ratio in np.linspace(0.0, 0.7, 15)])

    assert np.all(np.diff(along) > 0.0)
    assert np.all(np.diff(along, 2) > 0.0)

    few = PadRing(4, 6.67e9, 200.0, 0.034, 92.3)

    onto, between = film(few, 0.5, 0.0), film(few, 0.5, 45.0)

    turned = between.k_xx_n_per_m[0] + between.k_xy_n_per_m[0]  # along the diagonal
    assert onto.k_xx_n_per_m[0] > 1.3 * turned


@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.6])
def test_stiffness_grows_with_viscosity_and_speed_and_falls_with_the_cube_of_clearance(ratio):
    usual = k_xx(RING, ratio, 30.0)

    assert k_xx(RING, ratio, 30.0, viscosity_pa_s=0.068) == pytest.approx(2.0 * usual)
    assert k_xx(RING, ratio, 30.0, speed_rpm=46.15) == pytest.approx(0.5 * usual)
    assert k_xx(RING, ratio, 30.0, clearance_um=400.0) == pytest.approx(usual / 8.0)


def test_stiffness_of_uneven_pads_is_how_their_force_grows():
    pads_um: FloatArray = 200.0 + 20.0 * np.random.default_rng(5).standard_normal(16)
    angles, step_um = RING.pad_angles_rad, 1e-3
    towards = np.array([np.cos(angles), np.sin(angles)])

    def force_n(dx_um: float, dy_um: float) -> FloatArray:
        gaps_um = pads_um - np.array([40.0 + dx_um, -70.0 + dy_um]) @ towards
        oil = 0.03 / 0.034 * 90.0 / 92.3
        # one of 16 pads has an eighth of the centred stiffness at 200 µm; force as 1 / h²
        return np.asarray(towards @ (0.5 * 6.67e3 / 8.0 * 200.0**3 * oil / gaps_um**2))

    by_x = (force_n(step_um, 0.0) - force_n(-step_um, 0.0)) / (2e-6 * step_um)
    by_y = (force_n(0.0, step_um) - force_n(0.0, -step_um)) / (2e-6 * step_um)

    centre_um, oil = np.array([[40.0], [-70.0]]), (np.array([0.03]), np.array([90.0]))
    found = RING.film(pads_um[:, np.newaxis], centre_um, *oil).at(0)
    np.testing.assert_allclose(np.column_stack([by_x, by_y]), found.stiffness_n_per_m, rtol=1e-6)


def test_damping_is_that_of_the_paper_until_the_shaft_would_touch_a_pad():
    found = film(RING, 0.4, 20.0).at(0)

    np.testing.assert_allclose(found.damping_n_s_per_m, 0.0125 * found.stiffness_n_per_m)

    with pytest.raises(ValueError, match="touches a pad"):
        film(RING, 1.1, 11.25)


def test_the_oil_has_the_viscosities_of_tables_and_gets_thinner_as_it_warms():
    at_both = Oil().viscosity_pa_s(np.array([40.0, 100.0]))

    np.testing.assert_allclose(at_both, [0.047, 0.0068], rtol=1e-9)

    steps = np.diff(Oil().viscosity_pa_s(np.arange(0.0, 110.0)))

    assert np.all(steps < 0.0)
    assert np.all(np.diff(steps) > 0.0)

    with pytest.raises(ValueError, match=r"0\.05 Pa·s.*0\.047 Pa·s"):
        Oil(viscosity_100_pa_s=0.05)

    oil = Oil(46.0e-6 * 862.0, 6.78e-6 * 828.0, 875.0)

    kinematic = oil.viscosity_pa_s(np.array(20.0)) / oil.density_kg_per_m3(np.array(20.0))

    assert float(kinematic) * 1e6 == pytest.approx(137.0, rel=0.05)
