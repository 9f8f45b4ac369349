"""Chosen lives of an alarm, each as an operator would tell it."""

import pytest

from core.alarms.alarm import AlarmState
from core.alarms.life_cycle import next_level, restored
from core.alarms.operation import (
    Acknowledge,
    ActionRefusedError,
    Reset,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
    expire,
)
from core.limits import INACTIVE, ON, WITHIN, AlarmLevel, DelayTimer, Judgement, unknown
from core.units import NS_PER_S

ALERT = Judgement(AlarmLevel.ALERT, value=160.0, limit=150.0, reason="above_limit")
DANGER = Judgement(AlarmLevel.DANGER, value=210.0, limit=200.0, reason="above_limit")
LOST = unknown("sensor_failure")


def test_an_alarm_that_comes_is_seen_and_goes_is_normal_again(life):
    alarm = life()

    assert alarm.find(ALERT, 10) == ["raised"]
    assert alarm.alarm.state is AlarmState.UNACKNOWLEDGED
    assert alarm.ask(Acknowledge("A. Name", 1, "on my way"), 11) == ["acknowledged"]
    assert alarm.alarm.state is AlarmState.ACKNOWLEDGED
    assert alarm.find(WITHIN, 12) == ["returned"]
    assert alarm.alarm.state is AlarmState.NORMAL

    raised, seen, returned = alarm.events
    assert (raised.time_ns, raised.value, raised.limit) == (10, 160.0, 150.0)
    assert (raised.state_before, raised.state_after) == ("normal", "unacknowledged")
    assert (seen.actor, seen.reason, seen.time_ns) == ("A. Name", "on my way", 11)
    assert (returned.level, returned.occurrence) == (AlarmLevel.ALERT, 1)


def test_an_acknowledgement_of_the_last_occurrence_does_not_swallow_the_next(life):
    alarm = life()
    for condition, now in ((ALERT, 0), (WITHIN, 1), (ALERT, 2)):
        alarm.find(condition, now)

    with pytest.raises(
        ActionRefusedError, match="occurrence 1 is not the newest; check occurrence 2"
    ):
        alarm.ask(Acknowledge("A. Name", 1))

    assert alarm.alarm.state is AlarmState.UNACKNOWLEDGED
    assert alarm.ask(Acknowledge("A. Name", 2)) == ["acknowledged"]
    assert alarm.ask(Acknowledge("B. Name", 2)) == []


def test_a_lost_probe_keeps_an_alarm_active_and_says_that_it_is_not_known(life):
    alarm = life()
    alarm.find(DANGER, 0)

    assert alarm.find(LOST, 1) == ["condition_unknown"]
    assert alarm.find(LOST, 10**12) == []
    assert alarm.alarm.level is AlarmLevel.DANGER
    assert not alarm.alarm.condition.is_known
    last_known = alarm.alarm.condition
    assert (last_known.level, last_known.value, last_known.limit) == (2, 210.0, 200.0)
    assert alarm.events[-1].reason == "sensor_failure"
    assert alarm.find(WITHIN, 10**12 + 1) == ["condition_known", "returned"]


def test_a_clock_that_is_put_back_brings_no_delay_forward(life):
    alarm = life(on=10)

    for now in (100, 50, 59, 0):
        assert alarm.find(ALERT, now) == [], now
    assert alarm.find(ALERT, 1) == ["raised"]  # after 9 ns and 1 ns more


def test_a_latched_alarm_stays_until_it_is_seen_and_reset(life):
    alarm = life(latching=True)
    alarm.find(DANGER, 0)

    assert alarm.find(WITHIN, 1) == ["latched"]
    assert alarm.alarm.state is AlarmState.UNACKNOWLEDGED
    with pytest.raises(ActionRefusedError, match="acknowledged before"):
        alarm.ask(Reset("A. Name"))
    alarm.ask(Acknowledge("A. Name", 1))
    assert alarm.alarm.state is AlarmState.ACKNOWLEDGED
    assert alarm.ask(Reset("A. Name")) == ["reset"]
    assert alarm.alarm.state is AlarmState.NORMAL
    with pytest.raises(ActionRefusedError, match="nothing to reset"):
        alarm.ask(Reset("A. Name"))


def test_what_comes_again_while_it_is_latched_is_a_new_occurrence(life):
    alarm = life(latching=True)
    alarm.find(DANGER, 0)
    alarm.find(WITHIN, 1)
    alarm.alarm = restored(alarm.alarm)  # a latch survives a restart
    assert alarm.find(WITHIN, 1) == []
    assert (alarm.alarm.level, alarm.alarm.is_latched) == (AlarmLevel.DANGER, True)
    alarm.ask(Acknowledge("A. Name", 1))

    assert alarm.find(ALERT, 2) == ["raised"]
    assert alarm.alarm.state is AlarmState.UNACKNOWLEDGED
    assert (alarm.alarm.level, alarm.alarm.is_latched) == (AlarmLevel.DANGER, True)
    alarm.ask(Acknowledge("A. Name", 2))
    assert alarm.ask(Reset("A. Name")) == ["reset"]
    assert (alarm.alarm.level, alarm.alarm.state) == (AlarmLevel.ALERT, AlarmState.ACKNOWLEDGED)


def test_a_shelved_alarm_comes_back_by_itself_and_what_was_raised_meanwhile_waits(life):
    alarm = life()
    alarm.find(ALERT, 0)
    alarm.ask(Acknowledge("A. Name", 1))
    alarm.ask(Shelve("A. Name", "cable being changed", 50), 5)
    assert alarm.alarm.state is AlarmState.SHELVED

    same, none = expire(alarm.alarm, 49)
    back, [event] = expire(alarm.alarm, 50)

    assert (same, none) == (alarm.alarm, ())
    assert back.state is AlarmState.UNACKNOWLEDGED
    assert (event.change, event.time_ns, event.actor) == ("unshelved", 50, "")

    alarm = life()
    with pytest.raises(ActionRefusedError, match="must be later than the present time"):
        alarm.ask(Shelve("A. Name", "too late", 50), 50)
    alarm.ask(Shelve("A. Name", "test of the probes", 50), 0)

    assert alarm.find(ALERT, 10) == ["raised"]
    assert alarm.find(WITHIN, 20) == ["returned"]
    assert alarm.ask(Unshelve("A. Name"), 30) == ["unshelved"]

    assert alarm.alarm.state is AlarmState.RETURNED_UNACKNOWLEDGED
    assert alarm.ask(Unshelve("A. Name"), 31) == []


@pytest.mark.parametrize(
    ("set_by_s", "is_hidden"), [(0, True), (-59, True), (-61, False), (-365 * 86_400, False)]
)
def test_a_clock_that_was_ahead_when_an_alarm_was_shelved_does_not_hide_it_for_longer(
    life, set_by_s, is_hidden
):
    alarm, now_ns = life(), 1_767_225_600 * NS_PER_S
    alarm.find(ALERT, now_ns)
    alarm.ask(Acknowledge("A. Name", 1), now_ns)
    alarm.ask(Shelve("A. Name", "test of the probes", now_ns + 8 * 3600 * NS_PER_S), now_ns)

    after, events = expire(alarm.alarm, now_ns + set_by_s * NS_PER_S)

    if is_hidden:
        assert (after, events) == (alarm.alarm, ())
    else:
        assert after.state is AlarmState.UNACKNOWLEDGED
        assert [event.reason for event in events] == [
            "the clock was set back after the alarm was shelved"
        ]


def test_out_of_service_hides_more_than_the_shelf_and_ends_only_by_hand(life):
    alarm = life()
    alarm.find(ALERT, 0)
    alarm.ask(TakeOutOfService("B. Name", "overhaul"), 1)
    alarm.ask(Shelve("A. Name", "noise", 50), 2)

    assert alarm.alarm.state is AlarmState.OUT_OF_SERVICE
    alarm.alarm, _ = expire(alarm.alarm, 60)
    assert alarm.alarm.state is AlarmState.OUT_OF_SERVICE
    assert alarm.ask(ReturnToService("B. Name"), 70) == ["returned_to_service"]
    assert alarm.alarm.state is AlarmState.UNACKNOWLEDGED


PENDING_ON, PENDING_OFF = DelayTimer(False, 5, 1), DelayTimer(True, 5, 1)


@pytest.mark.parametrize(
    ("held", "timers", "expected"),
    [
        (None, [(INACTIVE, INACTIVE)], None),
        (None, [(PENDING_ON, INACTIVE)], 1),
        (1, [(ON, PENDING_ON)], 2),
        (1, [(PENDING_OFF, INACTIVE)], None),
        (2, [(ON, PENDING_OFF)], 1),
        (2, [(PENDING_OFF, PENDING_OFF)], None),
        (2, [(ON, ON), (ON, PENDING_OFF)], 2),
        (1, [(ON, INACTIVE), (PENDING_ON, INACTIVE)], 1),
    ],
)
def test_the_next_level_is_that_after_all_delays_that_are_running(held, timers, expected):
    assert next_level(held, timers) == expected
