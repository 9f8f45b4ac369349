"""Limits by operating state: where they count, and what happens elsewhere."""

import pytest

from core.alarms.alarm import AlarmLevel
from core.alarms.limits import Limits, judge
from core.alarms.state_limits import AT_SPEED, StateLimits
from core.alarms.zones import ZoneLimits
from core.condition.operating_state import OperatingState
from core.quality import Reading

ALERT, DANGER = AlarmLevel
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


def test_a_gap_returns_only_when_it_is_clearly_inside_again() -> None:
    assert judge(Reading(609.0), GAP, ALERT).level is ALERT
    assert judge(Reading(611.0), GAP, ALERT).level is None
    assert judge(Reading(409.0), GAP, DANGER).level is DANGER
    assert judge(Reading(411.0), GAP, DANGER).level is ALERT


def test_the_limits_of_the_present_state_count() -> None:
    found = StateLimits(((frozenset({FULL}), Limits(100.0)), (frozenset({PART}), Limits(150.0))))

    assert found.judge(Reading(120.0), FULL, None).level is ALERT
    assert found.judge(Reading(120.0), PART, None).level is None


@pytest.mark.parametrize("state", [RUN_UP, OperatingState.STANDSTILL, OperatingState.RUN_DOWN])
@pytest.mark.parametrize("value", [20.0, 120.0])
def test_elsewhere_nothing_is_judged_and_so_nothing_returns(
    state: OperatingState, value: float
) -> None:
    found = StateLimits.single(Limits(100.0), AT_SPEED).judge(Reading(value), state, ALERT)

    assert not found.is_known
    assert found.suppressed_by == found.reason == state.name.lower()


@pytest.mark.parametrize("state", [None, OperatingState.UNKNOWN])
def test_where_the_state_is_not_known_the_strictest_limits_count(
    state: OperatingState | None,
) -> None:
    found = StateLimits(((frozenset({PART}), Limits(150.0)), (frozenset({FULL}), Limits(100.0))))
    condition = found.judge(Reading(120.0), state, None)

    assert (condition.level, condition.limit, condition.suppressed_by) == (ALERT, 100.0, None)


def test_a_state_has_one_table() -> None:
    tables = ((frozenset({FULL, PART}), Limits(100.0)), (frozenset({FULL}), Limits(150.0)))
    with pytest.raises(ValueError, match="two limits for the operating state full_load"):
        StateLimits(tables)
    with pytest.raises(ValueError, match="count in no operating state"):
        StateLimits(((frozenset(), Limits(100.0)),))


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
    found = judge(Reading(value), ZoneLimits.between(1.0, 2.0, 3.0), None)

    assert (found.level, found.reason) == (level, zone)


@pytest.mark.parametrize("boundaries", [(0.0, 2.0, 3.0), (2.0, 2.0, 3.0), (1.0, 3.0, 3.0)])
def test_zones_that_do_not_rise_are_refused(boundaries: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        ZoneLimits.between(*boundaries)
