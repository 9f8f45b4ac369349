"""Who is told of what: by unit, kind, priority, and what somebody has taken off the list."""

import itertools
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, AlarmNews, AlarmRule, AlarmState
from core.alarms.life_cycle import update
from core.alarms.operation import (
    Acknowledge,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
    operate,
)
from core.limits import AlarmLevel, Judgement, unknown

T0 = 1_767_225_600_000_000_000
ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")
DANGER = Judgement(AlarmLevel.DANGER, value=260.0, limit=250.0, reason="above_limit")
WELL = Judgement(value=3.0)
STANDS = Judgement(value=3.0, suppressed_by="standstill")

SHELVE, UNSHELVE = Shelve("A. Name", "cable", T0 + 10**15), Unshelve("A. Name")
ANY = AlarmLevel.ALERT
HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


class Life:
    """An alarm that lives, step by step, and is stored after each."""

    def __init__(self, store: Any, unit: str = "U1", kind: str = "order1_shaft_x") -> None:
        self.alarm, self.store, self.now_ns = Alarm(AlarmIdentity(unit, "UJB", kind)), store, T0

    def go(self, *steps: Any) -> None:
        for step in steps:
            self.now_ns += 10**9
            if isinstance(step, Judgement):
                self.alarm, events = update(self.alarm, step, self.now_ns, AlarmRule())
            else:
                asked = step if not callable(step) else step(self.alarm)
                self.alarm, events = operate(self.alarm, asked, self.now_ns)
            if events:
                self.store.append([], [], [AlarmNews(self.alarm, tuple(events))])


def told(store: Any, receiver: str = "desk", unit: str = "%") -> list[tuple[str, bool]]:
    """What a receiver is told, in order: the change, and whether the alarm is active then."""
    with store._reader() as reader:
        rows = reader.execute(
            "SELECT change, is_active FROM outbox JOIN alarm_event USING (alarm, number)"
            " WHERE receiver = ? AND unit LIKE ? ORDER BY outbox.id",
            (receiver, unit),
        )
        return [(change, bool(is_active)) for change, is_active in rows]


@pytest.mark.parametrize(
    ("lowest", "steps", "expected"),
    [
        (ANY, [ALERT, DANGER, ALERT, WELL], ["raised", "escalated", "eased", "returned"]),
        (ANY, [SHELVE, ALERT, WELL, UNSHELVE], []),
        (ANY, [SHELVE, ALERT, UNSHELVE, WELL], ["unshelved", "returned"]),
        (ANY, [ALERT, SHELVE, WELL, UNSHELVE], ["raised", "returned"]),
        (ANY, [STANDS, WELL, STANDS, WELL], []),
        (ANY, [ALERT, STANDS, WELL], ["raised", "returned"]),
        (ANY, [WELL, unknown("stale"), ALERT, unknown("stale")], ["raised"]),
        (AlarmLevel.DANGER, [ALERT, WELL, ALERT, DANGER, ALERT, WELL], ["escalated", "eased"]),
        (AlarmLevel.DANGER, [DANGER, WELL], ["raised", "returned"]),
    ],
)
def test_what_is_off_the_list_is_told_when_it_comes_back_active_and_ends_are_never_owed(
    lowest: AlarmLevel, steps: list[Any], expected: list[str], room: Any
) -> None:
    store = room.open_store(room.routed("desk", lowest_priority=lowest.name.lower()))

    Life(store).go(*steps)

    assert [change for change, _ in told(store)] == expected


def test_each_is_told_of_the_units_and_kinds_that_it_has_asked_for(room: Any) -> None:
    store = room.open_store(
        room.routed("unit", units=("U2",)),
        room.routed("kind", kinds=("link_lost",)),
        room.routed("seen", changes=(AlarmChange.ACKNOWLEDGED,)),
    )

    Life(store, "U1", "link_lost").go(ALERT)
    Life(store, "U2").go(ALERT, lambda alarm: Acknowledge("A. Name", alarm.occurrence))

    found = {name: told(store, name) for name in ("unit", "kind", "seen")}
    assert found == {
        "unit": [("raised", True)],
        "kind": [("raised", True)],
        "seen": [("acknowledged", True)],
    }


NUMBERS = itertools.count()

STEPS = [
    ALERT,
    DANGER,
    WELL,
    STANDS,
    unknown("stale"),
    SHELVE,
    UNSHELVE,
    TakeOutOfService("B. Name", "overhaul"),
    ReturnToService("B. Name"),
    lambda alarm: Acknowledge("A. Name", alarm.occurrence),
]


@given(steps=st.lists(st.sampled_from(STEPS), max_size=14))
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_what_was_told_last_agrees_with_the_alarm_list(steps: list[Any], room: Any) -> None:
    store = room.open_store()
    unit = f"unit-{next(NUMBERS)}"
    life = Life(store, unit)
    for step in steps:
        life.go(step)
        believed = [is_active for _, is_active in told(store, unit=unit)][-1:] == [True]
        if life.alarm.level is None:
            assert not believed
        elif life.alarm.state not in HIDDEN:
            assert believed
    store.close()
