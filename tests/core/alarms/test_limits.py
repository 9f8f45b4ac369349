"""What limits say of readings, zones, films and vectors, and what is unknown there."""

import math
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.alarms.alarm import AlarmIdentity, AlarmRule, AlarmState
from core.alarms.judgements import (
    OrderVector,
    VectorReference,
    channel_judgement,
    drift_reading,
    fault_judgement,
    offset_reading,
    vector_judgement,
)
from core.alarms.kinds import Watch
from core.alarms.life_cycle import SAME_EVENT_NS
from core.alarms.operation import Acknowledge
from core.alarms.rules import LimitRule, Region, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.condition.cells import NOWHERE_KNOWN, OperatingPoint
from core.condition.operating_state import STEADY, OperatingState
from core.limits import AlarmLevel, Judgement, Limits, ZoneLimits, judge, unknown
from core.machine.unit import Unit
from core.quality import GOOD, Reading, Reason, bad, missing, uncertain
from core.samples.blocks import DeviceClock, StampFault

ALERT, DANGER = AlarmLevel
LIMITS = Limits(150.0, 200.0, 10.0)


def in_(*states: OperatingState) -> Region:
    return Region(frozenset(states))


LEVELS = st.sampled_from([None, ALERT, DANGER])


@given(value=st.floats(-1e3, 1e3), held=LEVELS)
def test_the_level_is_that_of_the_limits_give_or_take_the_deadband(value, held):
    level = LIMITS.passed(value, held)

    assert (level or 0) >= (2 if value > 200.0 else 1 if value > 150.0 else 0)
    assert (level or 0) <= (2 if value > 190.0 else 1 if value > 140.0 else 0)
    if (level or 0) > (held or 0):
        assert value > (LIMITS.of(level) or 0.0)  # the deadband only holds, it never raises
    assert LIMITS.passed(value, level) == level


def test_a_value_is_told_with_its_limit_and_a_doubtful_one_raises_but_does_not_clear():
    assert judge(Reading(210.0), LIMITS, None).limit == 200.0
    assert judge(Reading(160.0), LIMITS, None).limit == 150.0
    assert judge(Reading(10.0), LIMITS, None).limit == 150.0
    assert judge(Reading(10.0), Limits(danger=200.0), None).limit == 200.0

    doubt = uncertain(Reason.SPEED_IMPLAUSIBLE)

    assert judge(Reading(210.0, doubt), LIMITS, None).level is DANGER
    assert not judge(Reading(10.0, doubt), LIMITS, ALERT).is_known
    assert judge(Reading(10.0, doubt), LIMITS, None).is_known
    assert judge(Reading(10.0, uncertain(Reason.FEW_SEGMENTS)), LIMITS, ALERT).is_known


@pytest.mark.parametrize("reason", [Reason.SENSOR_FAILURE, Reason.DEAD, Reason.NOT_MEASURED])
def test_a_reading_without_a_number_is_unknown_and_standstill_alone_hides(reason):
    condition = judge(missing(reason), LIMITS, DANGER)

    assert (condition.is_known, condition.reason) == (False, reason)
    assert condition.suppressed_by is None
    assert judge(missing(Reason.STANDSTILL), LIMITS, DANGER).suppressed_by == "standstill"


def test_a_channel_a_clock_and_a_link_are_judged_by_what_is_known_of_them():
    assert channel_judgement(GOOD, None).level is None
    outside = channel_judgement(uncertain(Reason.SENSOR_FAILURE), None)
    assert (outside.level, outside.reason) == (ALERT, Reason.SENSOR_FAILURE)
    assert channel_judgement(bad(Reason.CLIPPED), None).reason == "clipped"
    assert channel_judgement(GOOD, Reason.STUCK).reason == "stuck"
    assert channel_judgement(bad(Reason.SENSOR_FAILURE), Reason.STUCK).reason == "sensor_failure"

    unclear = DeviceClock(None, None, None)
    fast = DeviceClock(offset_s=-3.0, drift_ppm=-250.0, u_drift_ppm=10.0)
    maybe = DeviceClock(offset_s=0.0, drift_ppm=250.0, u_drift_ppm=50.0)

    assert offset_reading(None).value is None
    assert offset_reading(unclear).value is None
    assert offset_reading(fast).value == 3.0
    assert drift_reading(None).value is None
    assert drift_reading(unclear).quality.reason is Reason.WAITING_FOR_DATA
    assert drift_reading(fast).value == pytest.approx(230.4)
    assert drift_reading(maybe).value == pytest.approx(152.0)  # more is not sure
    jumped = fault_judgement(StampFault.JUMPED)
    assert (jumped.level, jumped.reason) == (ALERT, "stamp_jumped")
    assert fault_judgement(None).level is None


FULL, PART, RUN_UP = OperatingState.FULL_LOAD, OperatingState.PART_LOAD, OperatingState.RUN_UP
GAP = Limits(2400.0, 2600.0, 10.0, alert_below=600.0, danger_below=400.0)


@pytest.mark.parametrize(
    ("gap_um", "level", "limit", "reason"),
    [
        (1499.0, None, 600.0, "ok"),
        (2399.0, None, 2400.0, "ok"),
        (2401.0, ALERT, 2400.0, "above_limit"),
        (2601.0, DANGER, 2600.0, "above_limit"),
        (599.0, ALERT, 600.0, "below_limit"),
        (399.0, DANGER, 400.0, "below_limit"),
    ],
)
def test_a_shaft_may_walk_out_of_a_probes_range_on_either_side(gap_um, level, limit, reason):
    found = judge(Reading(gap_um), GAP, None)

    assert (found.level, found.limit, found.reason) == (level, limit, reason)


def test_a_gap_returns_only_when_it_is_clearly_inside_the_limits_of_the_present_state():
    assert judge(Reading(609.0), GAP, ALERT).level is ALERT
    assert judge(Reading(611.0), GAP, ALERT).level is None
    assert judge(Reading(409.0), GAP, DANGER).level is DANGER
    assert judge(Reading(411.0), GAP, DANGER).level is ALERT

    found = LimitRule(
        None, AlarmRule(), tables=((in_(FULL), Limits(100.0)), (in_(PART), Limits(150.0)))
    )

    assert found.judge(Reading(120.0), OperatingPoint(FULL), None).level is ALERT
    assert found.judge(Reading(120.0), OperatingPoint(PART), None).level is None


@pytest.mark.parametrize("state", [RUN_UP, OperatingState.STANDSTILL, OperatingState.RUN_DOWN])
@pytest.mark.parametrize("value", [20.0, 120.0])
def test_elsewhere_nothing_is_judged_and_so_nothing_returns(state, value):
    limits = LimitRule(Limits(100.0), AlarmRule(), STEADY)
    found = limits.judge(Reading(value), OperatingPoint(state), ALERT)

    assert not found.is_known
    assert found.suppressed_by == found.reason == state.name.lower()


def test_where_the_state_is_not_known_the_strictest_limits_count():
    found = LimitRule(
        None, AlarmRule(), tables=((in_(PART), Limits(150.0)), (in_(FULL), Limits(100.0)))
    )
    condition = found.judge(Reading(120.0), OperatingPoint(), None)

    assert (condition.level, condition.limit, condition.suppressed_by) == (ALERT, 100.0, None)


@pytest.mark.parametrize(
    ("eccentricity", "attitude_deg", "oil_c", "passed"),
    [
        (0.35, 30.0, 45.0, [150.0]),
        (0.349, 30.0, 45.0, [100.0]),
        (0.4, 30.0, 45.0, [100.0]),
        (0.37, -330.0, 47.4, [150.0]),
        (0.37, 91.0, 46.0, [100.0]),
        (0.37, 30.0, 47.5, [60.0]),
        (None, 30.0, 46.0, [150.0, 100.0]),
        (0.37, None, None, [150.0, 60.0, 100.0]),
    ],
)
def test_a_condition_cell_has_limits_of_its_own_and_where_it_is_not_known_all_count_that_may(
    eccentricity, attitude_deg, oil_c, passed
):
    cell = Region(STEADY, (0.35, 0.4), (45.0, 47.5), (0.0, 90.0))
    warm = Region(STEADY, oil_temperature_c=(47.5, 50.0))
    tables = ((cell, Limits(150.0)), (warm, Limits(60.0)))
    found = LimitRule(Limits(100.0), AlarmRule(), STEADY, tables)
    point = OperatingPoint(FULL, eccentricity, attitude_deg, oil_c)

    assert [limits.alert for limits in found.at(point)] == passed
    condition = found.judge(Reading(120.0), point, None)
    assert condition.level is (ALERT if min(passed) < 120.0 else None)
    assert condition.limit == min(passed)


@pytest.mark.parametrize(
    ("value", "level", "zone"),
    [
        (0.9, None, "zone_a"),
        (1.9, None, "zone_b"),
        (2.1, ALERT, "zone_c"),
        (3.1, DANGER, "zone_d"),
    ],
)
def test_a_zone_is_named_also_when_it_is_no_alarm(value, level, zone):
    found = judge(Reading(value), ZoneLimits(2.0, 3.0, zone_b=1.0), None)

    assert (found.level, found.reason) == (level, zone)


FILM = "U1:UJB:film_stiffness"

LOST = Judgement(AlarmLevel.ALERT, value=-0.21, limit=0.1, reason="film")


@pytest.fixture
def alarms(unit: Unit) -> UnitAlarms:
    return UnitAlarms(unit, UnitRules(films=rule_of(0.0, 0.0)))


def changes(alarms: UnitAlarms, conditions: Mapping[str, Judgement], now_ns: int) -> list[str]:
    """Changes of the alarm of a film with these judgements of its directions."""
    news = alarms.films({FILM: conditions}, now_ns)
    return [event.change.value for told in news for event in told.events]


WELL_FILM = Judgement(value=-0.01, limit=0.1)
DEEPER = Judgement(AlarmLevel.DANGER, value=-0.4, limit=0.3, reason="film")
BLIND = unknown("insufficient_excitation")


def seen(alarms: UnitAlarms, now_ns: int) -> None:
    alarms.operate(FILM, Acknowledge("A. Name", alarms.alarm(FILM).occurrence), now_ns)


def test_a_film_has_one_alarm_that_announces_a_loss_with_its_size_and_direction(alarms, unit):
    ids = [alarm.identity.id for alarm in alarms.alarms]
    assert [id_ for id_ in ids if "stiffness" in id_] == [FILM]
    unwatched = UnitAlarms(unit, UnitRules())
    assert not [a for a in unwatched.alarms if "stiffness" in a.identity.id]
    with pytest.raises(KeyError):
        unwatched.films({FILM: {"x": LOST}}, 0)

    [news] = alarms.films({FILM: {"x": LOST, "y": WELL_FILM}}, 7)

    [event] = news.events
    found = (event.change.value, event.value, event.limit, event.time_ns, event.directions)
    assert found == ("raised", -0.21, 0.1, 7, "x")


@pytest.mark.parametrize(
    "verdict", ["no_baseline", "insufficient_excitation", "bad_quality", "transient"]
)
def test_a_film_that_cannot_be_judged_stays_in_alarm_and_says_why(alarms, verdict):
    changes(alarms, {"x": LOST, "y": WELL_FILM}, 0)

    blind = {"x": unknown(verdict), "y": WELL_FILM}
    assert changes(alarms, blind, 1) == ["condition_unknown"]
    alarm = alarms.alarm(FILM)
    assert (alarm.level, alarm.condition.reason) == (AlarmLevel.ALERT, verdict)
    assert alarm.condition.directions == "x"


def test_a_film_returns_when_the_directions_of_its_alarm_are_within_limits(alarms):
    changes(alarms, {"x": LOST, "y": WELL_FILM}, 0)

    assert changes(alarms, {"x": WELL_FILM, "y": BLIND}, 1) == ["returned"]
    changes(alarms, {"x": WELL_FILM, "y": BLIND}, 2)
    assert not alarms.alarm(FILM).condition.is_known


def test_both_directions_of_a_film_are_one_occurrence(alarms):
    assert changes(alarms, {"x": LOST, "y": LOST}, 0) == ["raised"]
    alarm = alarms.alarm(FILM)
    assert (alarm.occurrence, alarm.condition.directions) == (1, "xy")
    assert changes(alarms, {"x": DEEPER, "y": LOST}, 1) == ["escalated"]
    assert (alarms.alarm(FILM).condition.value, alarms.alarm(FILM).occurrence) == (-0.4, 2)
    assert changes(alarms, {"x": DEEPER, "y": DEEPER}, 2) == []
    assert changes(alarms, {"x": BLIND, "y": LOST}, 3) == []  # x is not known to have eased
    assert alarms.alarm(FILM).level is AlarmLevel.DANGER


def test_a_direction_that_follows_soon_belongs_to_the_occurrence_that_nobody_has_seen(alarms):
    changes(alarms, {"x": LOST, "y": WELL_FILM}, 1)

    assert changes(alarms, {"x": LOST, "y": LOST}, 1 + SAME_EVENT_NS) == []
    alarm = alarms.alarm(FILM)
    assert (alarm.occurrence, alarm.condition.directions) == (1, "xy")


@pytest.mark.parametrize(("is_seen", "after_ns"), [(True, 1), (False, SAME_EVENT_NS + 1)])
def test_a_direction_that_follows_later_or_after_an_acknowledgement_is_announced(
    alarms, is_seen, after_ns
):
    changes(alarms, {"x": LOST, "y": WELL_FILM}, 1)
    if is_seen:
        seen(alarms, 2)

    assert changes(alarms, {"x": LOST, "y": LOST}, 1 + after_ns) == ["raised"]
    alarm = alarms.alarm(FILM)
    assert (alarm.occurrence, alarm.state) == (2, AlarmState.UNACKNOWLEDGED)
    seen(alarms, 2 + after_ns)
    assert changes(alarms, {"x": WELL_FILM, "y": LOST}, 3 + after_ns) == []
    assert changes(alarms, {"x": BLIND, "y": LOST}, 4 + after_ns) == []


def test_a_direction_that_joins_while_the_other_eases_is_announced(alarms):
    changes(alarms, {"x": DEEPER, "y": WELL_FILM}, 1)
    seen(alarms, 2)

    assert changes(alarms, {"x": LOST, "y": LOST}, 3) == ["eased", "raised"]
    alarm = alarms.alarm(FILM)
    assert (alarm.level, alarm.is_latched) == (AlarmLevel.ALERT, False)


def test_a_film_that_was_never_judged_raises_nothing(alarms):
    assert changes(alarms, {"x": unknown("no_baseline"), "y": WELL_FILM}, 1) == []
    alarm = alarms.alarm(FILM)
    assert (alarm.state, alarm.condition.is_known) == (AlarmState.NORMAL, False)


def test_a_latched_loss_outlasts_the_healthy_verdict(unit):
    alarms = UnitAlarms(unit, UnitRules(films=rule_of(0.0, 0.0, is_latching=True)))
    changes(alarms, {"x": LOST, "y": WELL_FILM}, 0)

    assert changes(alarms, {"x": WELL_FILM, "y": WELL_FILM}, 1) == ["latched"]
    assert alarms.alarm(FILM).level is AlarmLevel.ALERT


VECTOR_LIMITS = Limits(30.0, 60.0, 2.0)
NO_PHASE = missing(Reason.NOT_MEASURED)
WELL = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0, 10.0)})
LENGTH = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)})


def judged(
    found: Mapping[str, Reading],
    reference: VectorReference | None,
    held: AlarmLevel | None,
    place: str = "shaft_x",
) -> Judgement:
    rule = LimitRule(VECTOR_LIMITS, rule_of(0.0, 0.0))
    identity = AlarmIdentity("U1", "UJB", f"order1_change_{place}")
    watch = Watch(identity, rule.rule, place, limits=rule)
    return vector_judgement(found, watch, reference, NOWHERE_KNOWN, held)


def readings(amplitude: Reading | float, phase: Reading | float) -> dict[str, Reading]:
    found = {"order1_shaft_x_um_pk": amplitude, "order1_shaft_x_phase_deg": phase}
    return {n: r if isinstance(r, Reading) else Reading(r) for n, r in found.items()}


def test_a_vector_that_turns_either_way_is_noticed_though_its_length_stays():
    found = judged(readings(60.0, 70.0), WELL, None)

    assert found.value == pytest.approx(60.0)  # 60° of an equilateral triangle
    assert found.level is ALERT
    assert found.reason == "above_limit"
    almost = judged(readings(60.0, 350.0), WELL, None)

    assert almost.value == pytest.approx(2 * 60.0 * math.sin(math.radians(10.0)))


@pytest.mark.parametrize("reference", [WELL, LENGTH])
@pytest.mark.parametrize(("amplitude", "level"), [(80.0, None), (95.0, ALERT), (25.0, ALERT)])
def test_without_a_phase_only_the_length_counts_and_that_is_said(reference, amplitude, level):
    found = judged(readings(amplitude, NO_PHASE), reference, None)

    assert (found.level, found.value) == (level, abs(amplitude - 60.0))
    assert found.reason.startswith("amplitude_change")


def test_without_a_reference_or_its_phase_nothing_is_known_and_standstill_suppresses():
    found = judged(readings(60.0, NO_PHASE), WELL, ALERT)

    assert (found.is_known, found.reason) == (False, "no_phase")

    standing = readings(missing(Reason.STANDSTILL), NO_PHASE)
    found = judged(standing, WELL, ALERT)

    assert (found.is_known, found.suppressed_by) == (False, "standstill")

    for reference, place in ((None, "shaft_x"), (WELL, "bearing_y")):
        there = readings(60.0, 10.0)
        there |= {n.replace("shaft_x", place): r for n, r in there.items()}
        found = judged(there, reference, None, place)
        assert (found.is_known, found.reason, found.suppressed_by) == (False, "no_reference", None)


@pytest.mark.parametrize("vector", [(math.nan, 0.0), (-1.0, 0.0), (60.0, math.inf)])
def test_a_vector_is_made_of_numbers(vector):
    with pytest.raises(ValueError, match="must be a number"):
        OrderVector(*vector)
