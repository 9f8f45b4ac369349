"""Values against limits, with a deadband, and what a reading cannot tell."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.alarms.alarm import AlarmLevel
from core.alarms.conditions import (
    channel_condition,
    drift_reading,
    link_condition,
    offset_reading,
    slow_channel_condition,
    stamp_condition,
)
from core.alarms.limits import Limits, judge
from core.device_clock import DeviceClock, StampFault
from core.quality import GOOD, Reading, Reason, bad, missing, uncertain

ALERT, DANGER = AlarmLevel
LIMITS = Limits(150.0, 200.0, 10.0)
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


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({}, "give alert, danger or both"),
        ({"alert": math.nan}, "limit nan must be a number above 0"),
        ({"danger": math.inf}, "limit inf"),
        ({"alert": 0.0}, "limit 0 must be"),
        ({"alert": -1.0}, "limit -1 must be"),
        ({"alert": 200.0, "danger": 200.0}, "alert 200 must be below danger 200"),
        ({"alert": 150.0, "deadband": 150.0}, "deadband 150 must be"),
        ({"alert": 150.0, "deadband": -1.0}, "deadband -1"),
        ({"alert": 150.0, "deadband": math.nan}, "deadband nan"),
        ({"alert_below": 0.0}, "limit 0 must be"),
        ({"alert_below": 400.0, "danger_below": 400.0}, "danger_below 400 must be below"),
        ({"alert_below": 500.0, "alert": 500.0}, "lower limit 500 must be below upper limit 500"),
        ({"alert_below": 400.0, "alert": 500.0, "deadband": 50.0}, "deadband 50 must be"),
    ],
)
def test_limits_that_make_no_sense_are_refused(limits: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Limits(**limits)


def test_a_value_is_told_with_the_limit_it_has_passed_or_would_pass_first() -> None:
    assert judge(Reading(210.0), LIMITS, None).limit == 200.0
    assert judge(Reading(160.0), LIMITS, None).limit == 150.0
    assert judge(Reading(10.0), LIMITS, None).limit == 150.0
    assert judge(Reading(10.0), Limits(danger=200.0), None).limit == 200.0


@pytest.mark.parametrize("reason", [Reason.SENSOR_FAILURE, Reason.DEAD, Reason.NOT_MEASURED])
def test_a_reading_without_a_number_is_unknown_and_standstill_alone_hides(reason: Reason) -> None:
    condition = judge(missing(reason), LIMITS, DANGER)

    assert (condition.is_known, condition.reason) == (False, reason)
    assert condition.suppressed_by is None
    assert judge(missing(Reason.STANDSTILL), LIMITS, DANGER).suppressed_by == "standstill"


def test_a_reading_beside_its_line_raises_but_does_not_clear() -> None:
    doubt = uncertain(Reason.SPEED_IMPLAUSIBLE)

    assert judge(Reading(210.0, doubt), LIMITS, None).level is DANGER
    assert not judge(Reading(10.0, doubt), LIMITS, ALERT).is_known
    assert judge(Reading(10.0, doubt), LIMITS, None).is_known
    assert judge(Reading(10.0, uncertain(Reason.FEW_SEGMENTS)), LIMITS, ALERT).is_known


def test_a_channel_is_judged_by_its_samples_and_by_its_segments() -> None:
    assert channel_condition(GOOD, None).level is None
    assert channel_condition(uncertain(Reason.SPEED_UNKNOWN), None).level is None
    assert channel_condition(bad(Reason.CLIPPED), None).reason == "clipped"
    assert channel_condition(GOOD, Reason.STUCK).reason == "stuck"
    assert channel_condition(bad(Reason.SENSOR_FAILURE), Reason.STUCK).reason == "sensor_failure"
    assert slow_channel_condition(missing(Reason.OUT_OF_RANGE)).level is ALERT
    assert slow_channel_condition(Reading(45.0)).level is None


def test_a_clock_is_judged_by_what_is_known_of_it() -> None:
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
    assert stamp_condition(StampFault.JUMPED).reason == "stamp_jumped"
    assert stamp_condition(None).level is None


def test_a_link_says_why_it_is_lost() -> None:
    assert link_condition(True, None).level is None
    assert link_condition(False, "refused").reason == "refused"
    assert link_condition(False, None).reason == "not connected"
