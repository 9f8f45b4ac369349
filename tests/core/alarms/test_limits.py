"""Values against limits, by operating state and with a deadband, and what a reading cannot tell."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.alarms.alarm import AlarmRule
from core.alarms.judgements import (
    channel_judgement,
    drift_reading,
    fault_judgement,
    offset_reading,
)
from core.alarms.rules import LimitRule, Region
from core.condition.cells import OperatingPoint
from core.condition.operating_state import STEADY, OperatingState
from core.limits import AlarmLevel, Limits, ZoneLimits, judge
from core.quality import GOOD, Reading, Reason, bad, missing, uncertain
from core.samples.blocks import DeviceClock, StampFault

ALERT, DANGER = AlarmLevel
LIMITS = Limits(150.0, 200.0, 10.0)


def in_(*states: OperatingState) -> Region:
    return Region(frozenset(states))


LEVELS = st.sampled_from([None, ALERT, DANGER])


@given(value=st.floats(-1e3, 1e3), held=LEVELS)
def test_the_level_is_that_of_the_limits_give_or_take_the_deadband(
    value: float, held: AlarmLevel | None
) -> None:
    level = LIMITS.passed(value, held)

    assert (level or 0) >= (2 if value > 200.0 else 1 if value > 150.0 else 0)
    assert (level or 0) <= (2 if value > 190.0 else 1 if value > 140.0 else 0)
    if (level or 0) > (held or 0):
        assert value > (LIMITS.of(level) or 0.0)  # the deadband only holds, it never raises
    assert LIMITS.passed(value, level) == level


def test_a_value_is_told_with_its_limit_and_a_doubtful_one_raises_but_does_not_clear() -> None:
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
def test_a_reading_without_a_number_is_unknown_and_standstill_alone_hides(reason: Reason) -> None:
    condition = judge(missing(reason), LIMITS, DANGER)

    assert (condition.is_known, condition.reason) == (False, reason)
    assert condition.suppressed_by is None
    assert judge(missing(Reason.STANDSTILL), LIMITS, DANGER).suppressed_by == "standstill"


def test_a_channel_a_clock_and_a_link_are_judged_by_what_is_known_of_them() -> None:
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
def test_a_shaft_may_walk_out_of_a_probes_range_on_either_side(
    gap_um: float, level: AlarmLevel | None, limit: float, reason: str
) -> None:
    found = judge(Reading(gap_um), GAP, None)

    assert (found.level, found.limit, found.reason) == (level, limit, reason)


def test_a_gap_returns_only_when_it_is_clearly_inside_the_limits_of_the_present_state() -> None:
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
def test_elsewhere_nothing_is_judged_and_so_nothing_returns(
    state: OperatingState, value: float
) -> None:
    limits = LimitRule(Limits(100.0), AlarmRule(), STEADY)
    found = limits.judge(Reading(value), OperatingPoint(state), ALERT)

    assert not found.is_known
    assert found.suppressed_by == found.reason == state.name.lower()


def test_where_the_state_is_not_known_the_strictest_limits_count() -> None:
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
    eccentricity: float | None, attitude_deg: float | None, oil_c: float | None, passed: list[float]
) -> None:
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
def test_a_zone_is_named_also_when_it_is_no_alarm(
    value: float, level: AlarmLevel | None, zone: str
) -> None:
    found = judge(Reading(value), ZoneLimits(2.0, 3.0, zone_b=1.0), None)

    assert (found.level, found.reason) == (level, zone)
