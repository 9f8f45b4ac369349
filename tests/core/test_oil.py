"""Walther's law through the two viscosities that are known."""

import numpy as np
import pytest

from core.oil import Oil


def test_the_oil_has_the_viscosities_of_table_1_at_both_temperatures() -> None:
    at_both = Oil().viscosity_pa_s(np.array([40.0, 100.0]))

    np.testing.assert_allclose(at_both, [0.047, 0.0068], rtol=1e-9)


def test_oil_gets_thinner_as_it_warms_and_ever_more_slowly() -> None:
    steps = np.diff(Oil().viscosity_pa_s(np.arange(0.0, 110.0)))

    assert np.all(steps < 0.0)
    assert np.all(np.diff(steps) > 0.0)


def test_an_oil_of_class_46_is_as_thick_when_cool_as_its_viscosity_index_says() -> None:
    # ISO VG 46 with a viscosity index of 100: 46.0 and 6.78 mm²/s at 40 °C and 100 °C, about
    # 137 mm²/s at 20 °C in makers' tables; 5 % is how much those differ among themselves.
    oil = Oil(46.0e-6 * 862.0, 6.78e-6 * 828.0, 875.0)

    kinematic = oil.viscosity_pa_s(np.array(20.0)) / oil.density_kg_per_m3(np.array(20.0))

    assert float(kinematic) * 1e6 == pytest.approx(137.0, rel=0.05)


def test_an_oil_that_is_thicker_when_hot_is_refused_with_both_values() -> None:
    with pytest.raises(ValueError, match=r"0\.05 Pa·s.*0\.047 Pa·s"):
        Oil(viscosity_100_pa_s=0.05)
