"""Slow quantities, brackets of unknown stiffness and probes at any angle, in the unit monitor."""

from dataclasses import replace

import numpy as np
import pytest

from core.machine.channel import SlowChannel
from core.monitor.catalogue import quantity_of
from core.quality import Level, Reason, missing


def test_slow_quantities_of_bearing_and_unit_are_read_beside_the_vibration(unit, results, signals):
    recorded = (
        SlowChannel("oil", "pad_temperature", "UJB", "1", 0.0),
        SlowChannel("power", "gate_opening"),
        SlowChannel("absent", "head"),
        SlowChannel("oil", "stator_temperature", "LJB"),
    )
    readings = results(signals(14.0), replace(unit, slow_channels=recorded))[-1].readings
    assert readings["pad_temperature_1_c"].value == 45.0
    assert readings["gate_opening_percent"].value == 650.0
    assert readings["head_m"] == missing(Reason.NOT_MEASURED)
    assert "stator_temperature_c" not in readings
    assert quantity_of("pad_temperature_1_c").label == "Pad temperature 1"
    with pytest.raises(KeyError):
        quantity_of("head_c")


def test_without_a_bracket_stiffness_films_are_ratios_and_nothing_is_absolute(
    unit, results, signals
):
    [bearing] = unit.bearings
    accuracy = replace(bearing.accuracy, bracket_stiffness=0.0)
    unknown = replace(bearing, bracket_stiffness_n_per_m=None, accuracy=accuracy)
    rows = signals(60.0)
    known = results(rows)[-1]
    found = results(rows, replace(unit, bearings=(unknown,)))[-1]
    for name in ("stiffness_xx", "order1_k_eff_yy", "order1_transfer_k_xx"):
        ratio, stiffness = found.readings[f"{name}_of_kb"], known.readings[f"{name}_n_per_m"]
        assert ratio.value == pytest.approx((stiffness.value or 0.0) / 1.18e9, rel=1e-9)
        assert found.readings[f"{name}_n_per_m"] == missing(Reason.BRACKET_UNKNOWN)
        assert (quantity_of(f"{name}_of_kb").unit, ratio.quality) == ("1", stiffness.quality)
    damping = known.readings["order1_transfer_c_xx_n_s_per_m"].value or 0.0
    of_kb_s = found.readings["order1_transfer_c_xx_of_kb_s"].value
    assert of_kb_s == pytest.approx(damping / 1.18e9, rel=1e-6)
    assert found.quality == known.quality
    assert not [name for name in found.budgets if name.endswith(("_n_per_m", "_n_s_per_m"))]


@pytest.mark.parametrize("angles_deg", [(45.0, 135.0), (10.0, 70.0), (90.0, 0.0)])
def test_probes_at_any_two_angles_read_what_probes_in_x_and_y_do(
    unit, results, signals, angles_deg
):
    """An orbit that is no circle, with the shaft off the centre."""
    rows = signals(60.0, noise_um=0.01, gaps_um=(1950.0, 2060.0))
    rows[1] = 2060.0 + 0.5 * (rows[1] - 2060.0)
    rows[3] *= 0.25
    one, other = np.deg2rad(angles_deg)
    turned = np.array([[np.cos(one), np.sin(one)], [np.cos(other), np.sin(other)]])
    gaps = 2000.0 + turned @ (rows[:2] - 2000.0)
    shaft = [
        replace(channel, angle_deg=at)
        for channel, at in zip(unit.channels[:2], angles_deg, strict=True)
    ]
    at_angles = replace(unit, channels=(*shaft, *unit.channels[2:]))
    wanted, found = (
        results(rows)[-1],
        results(np.concatenate([gaps, rows[2:]]), at_angles)[-1],
    )
    names = (
        *("order1_k_eff_xx_n_per_m", "order1_k_eff_yy_n_per_m", "order1_shaft_y_um_pk"),
        *("order1_roundness", "shaft_centre_x_um", "shaft_centre_y_um", "attitude_angle_deg"),
        "overall_shaft_um_pk",
    )
    for name in names:
        assert found.readings[name].value == pytest.approx(wanted.readings[name].value, rel=1e-4)
        assert found.readings[name].quality == wanted.readings[name].quality
    assert found.recent[-1].readings["order1_shaft_y_um_pk"].value == pytest.approx(
        wanted.recent[-1].readings["order1_shaft_y_um_pk"].value, rel=1e-4
    )
    assert found.orbit is not None
    assert wanted.orbit is not None
    np.testing.assert_allclose(found.orbit.shaft_y_um, wanted.orbit.shaft_y_um, atol=0.1)


def test_a_dead_probe_at_an_angle_takes_x_and_y_but_is_the_only_one_called_dead(
    unit, results, signals
):
    rows = signals(60.0)
    rows[0] = 2000.0
    shaft = [
        replace(c, angle_deg=at) for c, at in zip(unit.channels[:2], (30.0, 120.0), strict=True)
    ]
    readings = results(rows, replace(unit, channels=(*shaft, *unit.channels[2:])))[-1].readings
    assert readings["order1_shaft_x_um_pk"].quality.reason in (Reason.DEAD, Reason.STUCK)
    assert readings["order1_shaft_y_um_pk"] == missing(Reason.REDUCED_PROBES)
    assert readings["stiffness_yy_n_per_m"].quality.level is Level.BAD
    assert readings["gap_y_um"].value is not None
