"""A life second by second is the life of the readings: past, present and course are one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.simulated.life.course import LifeCourse, LifePlan, history_until
from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.inputs import LifeInputs, draw_inputs
from acquisition.simulated.life.life import live
from acquisition.simulated.life.operation import HeldLoad
from acquisition.simulated.plant.unit import SimulatedUnit
from benchmarks.chain_unit import CALIBRATION, UNIT
from core.units import NS_PER_S, rad_s_from_rpm

START_NS = 1_735_689_600 * NS_PER_S
STEP_NS = 600 * NS_PER_S
SEED, YEARS = 4, 0.3
NOW_NS = 1_794_657_615 * NS_PER_S
"""14 November 2026, some time in the morning."""
PLAN = LifePlan(2, held_load=0.95)


@pytest.fixture(scope="module")
def inputs() -> LifeInputs:
    return draw_inputs(SEED, START_NS, YEARS)


def running_ns(inputs: LifeInputs) -> int:
    """A reading in the middle of an hour under load."""
    loaded = inputs.operation.load > 0.5
    rows = np.flatnonzero(np.convolve(loaded, np.ones(7), "same") == 7)
    return int(inputs.operation.time_ns[rows[rows.size // 2]])


def test_at_a_reading_the_course_is_what_the_reading_was_made_of(inputs):
    now_ns = running_ns(inputs)
    onset_ns = now_ns - 10 * STEP_NS
    damage = (
        Damage(DamageKind.PIVOT_WEAR, "LJB", onset_ns, 0.1),
        Damage(DamageKind.BRACKET_LOOSENING, "LJB", onset_ns, 0.2),
        Damage(DamageKind.ACCELEROMETER_GAIN, "UJB", onset_ns, -0.2, directions=("y",)),
    )
    found = LifeCourse(inputs, damage, UNIT, now_ns).at(0.0)
    life = live(SEED, START_NS, YEARS, damage)
    row = int(np.searchsorted(life.operation.time_ns, now_ns))

    assert found.speed_rpm == life.operation.speed_rpm[row]
    assert found.active_power_mw == life.operation.power_mw[row]
    assert found.unbalance_grade_mm_s == life.grade_mm_s[row]
    for name, here in found.bearings.items():
        truth, film = life.truth[name], here.film.at(rad_s_from_rpm(found.speed_rpm))
        assert math.log(film.k_yy_n_per_m) == pytest.approx(truth.ln_k[1, row])
        assert (here.centre_x_um, here.centre_y_um) == pytest.approx(truth.centre_um[:, row])
        assert here.oil_temperature_c == pytest.approx(truth.oil_temperature_c[row])
        growth_um = truth.clearance_um[row] - np.median(truth.clearance_um)
        # the median has the damage in it
        assert here.gap_growth_um == pytest.approx(growth_um, abs=4.0)
    assert found.bearings["LJB"].bracket_stiffness_factor == pytest.approx(0.8)
    chain, strays = life.truth["UJB"].chain, math.exp(life.truth["UJB"].chain.ln_k_error[1, row])
    assert found.channels["UJB_ay"].gain == pytest.approx(
        0.8 * chain.accelerometer_gain[1] * strays
    )
    assert found.channels["UJB_ux"].gain == chain.probe_gain[0]


def test_the_vortex_is_there_at_part_load_only(inputs):
    part, full = (
        LifeCourse(inputs, (), UNIT, int(inputs.operation.time_ns[np.flatnonzero(near)[0]])).at(0.0)
        for near in (np.abs(inputs.operation.load - load) < 0.02 for load in (0.57, 0.97))
    )

    assert part.rope.force_n > 0.0
    assert full.rope.force_n == 0.0
    assert part.hydraulic.rms_n > 0.0


def test_damage_sets_in_to_the_second_and_grows_as_told(inputs):
    now_ns = running_ns(inputs)
    loss = Damage(DamageKind.STIFFNESS_LOSS, "UJB", now_ns + 100 * NS_PER_S, 0.2, 60.0 / 86_400.0)
    healthy, damaged = (LifeCourse(inputs, d, UNIT, now_ns) for d in ((), (loss,)))
    for seconds, left in ((99.0, 1.0), (130.0, 0.9), (161.0, 0.8)):
        before, after = (c.at(seconds).bearings["UJB"].film for c in (healthy, damaged))
        assert after.k_yy_n_per_m / before.k_yy_n_per_m == pytest.approx(left)


def test_a_unit_that_stands_still_is_sampled_too(inputs):
    standing = np.flatnonzero(~inputs.operation.is_turning)
    now_ns = int(inputs.operation.time_ns[standing[5]])
    unit = SimulatedUnit(UNIT, CALIBRATION, LifeCourse(inputs, (), UNIT, now_ns), 1, now_ns)
    unit.advance(9000)
    block = unit.advance(6000)
    gap_um = 250.0 * 20.0 / 32768.0 * block.counts[0].astype(np.float64)

    assert block.side.slow[:2, 0].tolist() == [0.0, 0.0]
    assert 15.0 < block.side.slow[2, 0] < 60.0
    assert np.std(gap_um) == pytest.approx(1.2, rel=0.1)


def test_a_unit_that_is_kept_running_never_stops_and_has_the_same_past(inputs):
    from_ns = START_NS + 60 * 144 * STEP_NS
    held = draw_inputs(SEED, START_NS, YEARS, held=HeldLoad(from_ns, 0.9))
    later = inputs.operation.time_ns >= from_ns

    assert not inputs.operation.is_at_speed[later].all()
    assert held.operation.is_at_speed[later][3:].all()
    assert held.operation.load[later][3:] == pytest.approx(0.9, abs=0.03)
    assert np.array_equal(held.operation.speed_rpm[~later], inputs.operation.speed_rpm[~later])
    for one, other in zip(held.bearings, inputs.bearings, strict=True):
        assert np.array_equal(one.position_um[:, ~later], other.position_um[:, ~later])


def test_what_cannot_be_is_refused(inputs):
    with pytest.raises(ValueError, match=r"load = 1\.2 must be above 0"):
        HeldLoad(0, 1.2)
    with pytest.raises(ValueError, match="outside the life of unit 4"):
        LifeCourse(inputs, (), UNIT, START_NS - 1)
    strange = replace(UNIT, bearings=(replace(UNIT.bearings[0], id="XJB"),))
    with pytest.raises(KeyError):
        LifeCourse(inputs, (), strange, running_ns(inputs))
    loss = Damage(DamageKind.STIFFNESS_LOSS, "XJB", START_NS, math.nextafter(0.2, 1.0))
    with pytest.raises(ValueError, match="unknown bearing 'XJB'"):
        LifeCourse(inputs, (loss,), UNIT, running_ns(inputs))
    with pytest.raises(ValueError, match="unknown bearing 'XJB'"):
        history_until(LifePlan(2, damage=(loss,)), NOW_NS)
    with pytest.raises(ValueError, match="years = 2 is longer than the life of unit 2"):
        history_until(PLAN, NOW_NS, years=2.0)


def test_readings_reach_until_now_and_a_year_back():
    life = history_until(PLAN, NOW_NS)
    for history in life.readings.values():
        assert NOW_NS - STEP_NS <= history.time_ns[-1] < NOW_NS
        assert 364.0 < (history.time_ns[-1] - history.time_ns[0]) / (86_400 * NS_PER_S) <= 365.25


@pytest.mark.long
def test_a_unit_watched_again_tomorrow_has_the_same_past():
    today, tomorrow = (history_until(LifePlan(2), ns) for ns in (NOW_NS, NOW_NS + 144 * STEP_NS))
    for name, history in today.readings.items():
        shared = np.isin(tomorrow.readings[name].time_ns, history.time_ns)
        both = np.isin(history.time_ns, tomorrow.readings[name].time_ns)
        assert both.mean() > 0.99
        again = tomorrow.readings[name].eccentricity_ratio[shared]
        assert np.array_equal(again, history.eccentricity_ratio[both])
