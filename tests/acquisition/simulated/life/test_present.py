"""A unit's past as readings and its present as samples are one life."""

import numpy as np
import pytest
from rigs.tiers import fast_and_long

from acquisition.delivery import Delivery
from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.present import LifePlan, course_from, history_until
from acquisition.simulated.plant import CHUNK_SAMPLES
from acquisition.simulated.unit import SimulatedUnit
from benchmarks.chain_unit import CALIBRATION, SETTINGS, UNIT, UNKNOWN, WINDOW_SAMPLES
from core.assessment import Assessment
from core.estimators import Estimator
from core.films.film_reading import film_reading
from core.monitor import UnitMonitor
from core.units import NS_PER_S, ns_from_s

NOW_NS = 1_794_657_615 * NS_PER_S
"""14 November 2026, some time in the morning."""

STEP_NS = 600 * NS_PER_S
PLAN = LifePlan(2, held_load=0.95)


def test_readings_reach_until_now_and_a_year_back() -> None:
    life = history_until(PLAN, NOW_NS)
    for history in life.readings.values():
        assert NOW_NS - STEP_NS <= history.time_ns[-1] < NOW_NS
        assert 364.0 < (history.time_ns[-1] - history.time_ns[0]) / (86_400 * NS_PER_S) <= 365.25


def test_a_unit_watched_again_tomorrow_has_the_same_past() -> None:
    today, tomorrow = (history_until(LifePlan(2), ns) for ns in (NOW_NS, NOW_NS + 144 * STEP_NS))
    for name, history in today.readings.items():
        shared = np.isin(tomorrow.readings[name].time_ns, history.time_ns)
        both = np.isin(history.time_ns, tomorrow.readings[name].time_ns)
        assert both.mean() > 0.99
        again = tomorrow.readings[name].eccentricity_ratio[shared]
        assert np.array_equal(again, history.eccentricity_ratio[both])


@pytest.mark.parametrize("damage_h", fast_and_long(-1.0, 24.0))
def test_samples_go_on_where_readings_stop(damage_h: float) -> None:
    """Five minutes of samples read as the life says, with a film that is damaged, or will be."""
    onset_ns = NOW_NS + round(damage_h * 3600) * NS_PER_S
    plan = LifePlan(2, 0.95, (Damage(DamageKind.STIFFNESS_LOSS, "LJB", onset_ns, 0.2),))
    window_ns = ns_from_s(WINDOW_SAMPLES / UNIT.rate_hz)
    unit = SimulatedUnit(UNIT, CALIBRATION, course_from(plan, NOW_NS, UNIT), 5, NOW_NS)
    delivery, monitor = Delivery(CALIBRATION), UnitMonitor(UNIT, SETTINGS)
    newest: list[Assessment] = []
    for _ in range(WINDOW_SAMPLES // CHUNK_SAMPLES + 1):
        for block in delivery.take(unit.advance(CHUNK_SAMPLES)):
            newest = monitor.ingest(block) or newest

    life = history_until(plan, NOW_NS + window_ns + STEP_NS)
    middle_ns = NOW_NS + window_ns // 2
    for assessment in newest:
        found = film_reading(assessment, UNKNOWN, Estimator.DYNAMIC)
        history = life.readings[assessment.bearing]
        row = int(np.argmin(np.abs(history.time_ns - middle_ns)))
        for axis, value in enumerate(found.values):
            apart = value.ln_k - history.ln_k[axis, row]
            # a reading of the life strays by chance; so does the film within half a step
            assert abs(apart) < 4.0 * np.hypot(value.u_random, history.u_random[axis, row]) + 0.01
        assert found.eccentricity_ratio == pytest.approx(history.eccentricity_ratio[row], abs=0.01)
        assert found.oil_temperature_c == pytest.approx(history.oil_temperature_c[row], abs=0.2)
        assert found.speed_rpm == pytest.approx(history.speed_rpm[row], rel=1e-3)
        shaft_um = history.shaft_um_pk[:, row]
        assert [v.shaft_um_pk for v in found.values] == pytest.approx(list(shaft_um), rel=0.1)


def test_a_past_beyond_the_life_is_refused() -> None:
    with pytest.raises(ValueError, match="years = 2 reach back beyond the life of unit 2"):
        history_until(PLAN, NOW_NS, years=2.0)
    loss = Damage(DamageKind.STIFFNESS_LOSS, "XJB", NOW_NS, 0.2)
    with pytest.raises(ValueError, match="'XJB' is none of"):
        history_until(LifePlan(2, damage=(loss,)), NOW_NS)
