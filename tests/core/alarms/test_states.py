"""Alarms of one unit through its operating states."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from core.alarms.alarm import AlarmEvent, AlarmState
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.operation import Acknowledge
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.condition.cells import BearingCondition, OperatingPoint
from core.condition.operating_state import STEADY, OperatingState
from core.limits import Limits
from core.machine.unit import Unit
from core.monitor.catalogue import CATALOGUE
from core.quality import GOOD, Reading, Reason, bad, missing
from core.samples.blocks import SampleBlock

SECOND = 1_000_000_000
AT_ONCE = rule_of(0.0, 0.0)
FULL, PART = OperatingState.FULL_LOAD, OperatingState.PART_LOAD
RUN_DOWN, STANDING = OperatingState.RUN_DOWN, OperatingState.STANDSTILL
SPAN = "U1:UJB:overall_shaft_x"


def rule(limits: Limits, states: frozenset[OperatingState] = STEADY) -> LimitRule:
    return LimitRule(limits, AT_ONCE, states)


RULES = UnitRules(
    bearings={
        "UJB": {
            "shaft_overall": rule(Limits(200.0)),
            "eccentricity": rule(Limits(0.7, 0.9)),
            "gap": rule(Limits(2400.0, alert_below=600.0)),
            "shaft_change": rule(Limits(30.0)),
            "oil_temperature": rule(Limits(60.0), frozenset({FULL})),
        }
    },
)


class Machine:
    """A unit with its alarms, and everything within limits unless said otherwise."""

    def __init__(self, unit: Unit, block: Callable[..., SampleBlock]) -> None:
        reference = VectorReference("U1", "UJB", FULL, {"shaft_x": OrderVector(50.0)})
        self.alarms = UnitAlarms(unit, RULES, references=[reference])
        self.block, self.n = block, 0
        self.told: list[AlarmEvent] = []

    def runs(self, state: OperatingState | None, oil_c: float = 45.0, **found: Any) -> list[str]:
        self.n += 1
        readings = {quantity.name: Reading(1.0) for quantity in CATALOGUE}
        readings |= {"gap_x_um": Reading(1500.0), "gap_y_um": Reading(1500.0)}
        readings |= {"eccentricity_ratio": Reading(0.3), "order1_shaft_x_um_pk": Reading(50.0)}
        readings |= {n: r if isinstance(r, Reading) else Reading(r) for n, r in found.items()}
        condition = state if state is None else BearingCondition(state, False, None)
        assessment: Any = SimpleNamespace(
            recent=(),
            unit="U1",
            bearing="UJB",
            time_ns=self.n * SECOND,
            readings=readings,
            condition=condition,
            clipped_share={},
        )
        news = self.alarms.take(self.block(self.n, oil_c), [assessment], 0)
        self.told += [event for told in news for event in told.events]
        return [f"{e.identity.kind} {e.change}" for told in news for e in told.events]

    def state(self, id_: str) -> AlarmState:
        return self.alarms.alarm(id_).state


@pytest.fixture
def machine(unit: Unit, block: Callable[..., SampleBlock]) -> Machine:
    return Machine(unit, block)


@pytest.mark.parametrize(
    ("found", "raised"),
    [
        ({"overall_shaft_x_um_pp": 210.0}, "overall_shaft_x raised"),
        ({"eccentricity_ratio": 0.95}, "eccentricity_ratio raised"),
        ({"gap_y_um": 590.0}, "gap_y raised"),
        ({"gap_x_um": 2410.0}, "gap_x raised"),
        ({"order1_shaft_x_um_pk": 90.0}, "order1_change_shaft_x raised"),
    ],
)
def test_each_measurement_has_its_alarm(machine, found, raised):
    assert machine.runs(FULL) == []
    assert machine.runs(FULL, **found) == [raised]


def test_a_machine_that_runs_down_shakes_without_an_alarm(machine):
    machine.runs(FULL)
    shaking = machine.runs(RUN_DOWN, overall_shaft_x_um_pp=900.0)

    assert not [words for words in shaking if words.endswith("raised")]
    assert "overall_shaft_x suppressed" in shaking
    assert machine.alarms.alarm(SPAN).suppressed_by == "run_down"


def test_an_alarm_that_a_stop_hides_has_not_returned_and_is_told_again(machine):
    machine.runs(FULL, overall_shaft_x_um_pp=210.0)
    told = [w for state in (RUN_DOWN, STANDING, STANDING) for w in machine.runs(state)]
    assert machine.state(SPAN) is AlarmState.SUPPRESSED
    assert machine.alarms.alarm(SPAN).level is not None

    back = machine.runs(FULL, overall_shaft_x_um_pp=210.0)

    assert not any("returned" in words for words in [*told, *back])
    assert "overall_shaft_x unsuppressed" in back
    assert machine.state(SPAN) is AlarmState.UNACKNOWLEDGED


def test_where_the_state_is_not_known_nothing_is_suppressed_but_by_standing(machine):
    assert machine.runs(None, overall_shaft_x_um_pp=210.0) == ["overall_shaft_x raised"]
    assert not [a for a in machine.alarms.alarms if a.suppressed_by is not None]

    standing = machine.runs(None, speed_rpm=missing(Reason.STANDSTILL), eccentricity_ratio=0.99)

    assert "eccentricity_ratio raised" not in standing
    assert machine.alarms.alarm("U1:UJB:eccentricity_ratio").suppressed_by == "standstill"


def test_a_vector_has_a_reference_in_the_state_it_was_taken_in(machine):
    machine.runs(PART, order1_shaft_x_um_pk=90.0)
    alarm = machine.alarms.alarm("U1:UJB:order1_change_shaft_x")
    assert (alarm.condition.is_known, alarm.condition.reason) == (False, "no_reference")

    machine.alarms.refer_to(VectorReference("U1", "UJB", PART, {"shaft_x": OrderVector(50.0)}))
    assert machine.runs(PART, order1_shaft_x_um_pk=90.0) == ["order1_change_shaft_x raised"]


def test_an_alarm_shows_what_was_found_last_and_slow_channels_share_the_state(machine):
    machine.runs(FULL, overall_shaft_x_um_pp=120.0)
    machine.runs(FULL, overall_shaft_x_um_pp=130.0)

    assert machine.alarms.alarm(SPAN).condition.value == 130.0

    assert "oil_temperature raised" not in machine.runs(PART, oil_c=65.0)
    assert "oil_temperature raised" in machine.runs(FULL, oil_c=65.0)


def test_an_alarm_and_its_events_carry_the_condition_at_which_it_was_raised(machine):
    there = {"eccentricity_ratio": 0.4, "attitude_angle_deg": 47.0, "oil_temperature_c": 52.0}
    machine.runs(FULL, **there, overall_shaft_x_um_pp=210.0)
    failed = (bad(Reason.SENSOR_FAILURE), *(GOOD,) * 3, bad(Reason.DEAD))
    blocks = [machine.block(second, qualities=failed) for second in (60, 61)]
    of_channels = [told for block in blocks for told in machine.alarms.take(block, [], 0)]
    machine.n = 100
    machine.runs(PART, overall_shaft_x_um_pp=120.0)
    machine.alarms.operate(SPAN, Acknowledge("A. Name", 1), 0)
    raised_anew = machine.alarms.take(machine.block(401, 65.0), [], 0)  # of no recent result

    point = OperatingPoint(FULL, 0.4, 47.0, 52.0)
    assert machine.alarms.alarm(SPAN).raised_at == point
    of_span = [e for e in machine.told if e.identity.id == SPAN]
    assert [(e.change, e.raised_at) for e in of_span] == [("raised", point), ("returned", point)]
    seen = {e.identity.subject: e.raised_at for told in of_channels for e in told.events}
    assert seen == {"sx": point, "spare": OperatingPoint(FULL)}
    [oil] = [e for told in raised_anew for e in told.events if e.change == "raised"]
    assert oil.raised_at == OperatingPoint()
