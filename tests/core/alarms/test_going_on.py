"""Alarms of a unit that go on elsewhere: by what was known of them, and by what is stored."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest

from core.alarms.alarm import Alarm, AlarmNews, AlarmState
from core.alarms.operation import Acknowledge, Action, Comment
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import AlarmLevel, Limits
from core.machine.unit import Unit
from core.samples.blocks import SampleBlock

SECOND = 1_000_000_000
OIL = "U1:UJB:oil_temperature"
LINK = "U1:link:link_lost"
WATCHED = UnitRules(
    bearings={"UJB": {"oil_temperature": LimitRule(Limits(65.0), rule_of(0.0, 0.0))}},
    clock_offset=None,
    clock_drift=None,
    time_stamps=None,
    link=rule_of(10.0, 0.0),
)
NO_LIMIT = replace(WATCHED, bearings={})


class Lives:
    """One process after the other, each with what the ones before have stored."""

    def __init__(self, unit: Unit, block: Callable[..., SampleBlock]) -> None:
        self.unit, self.block = unit, block
        self.stored: dict[str, Alarm] = {}
        self.events: list[tuple[str, str, str]] = []
        self.alarms = UnitAlarms(unit, WATCHED)
        self.memory = self.alarms.memory

    def restart(self, rules: UnitRules = WATCHED) -> None:
        """Begin anew where the memory was stored last."""
        self.alarms = UnitAlarms(self.unit, rules)
        self.store(self.alarms.restore(self.stored.values(), 0, self.memory))

    def take(self, second: int, oil: float = 45.0) -> None:
        """Take a block in; how far that is is stored with what it brings."""
        self.store(self.alarms.take(self.block(second, oil), [], second * SECOND))
        self.memory = self.alarms.memory

    def hear(self, is_connected: bool, *seconds: int) -> None:
        """Hear of the link, and let time pass; nothing is kept with that but events."""
        self.store(self.alarms.link(is_connected, None, seconds[0] * SECOND))
        self.wait(*seconds[1:])

    def wait(self, *seconds: int) -> None:
        for second in seconds:
            self.store(self.alarms.tick(second * SECOND))

    def ask(self, id_: str, action: Action) -> None:
        self.store(self.alarms.operate(id_, action, 0))

    def store(self, news: Iterable[AlarmNews]) -> None:
        for told in news:
            self.stored[told.alarm.identity.id] = told.alarm
            self.events += [(e.identity.id, e.change.value, e.reason) for e in told.events]

    def changes(self, id_: str) -> list[str]:
        return [change for alarm, change, _ in self.events if alarm == id_]


@pytest.fixture
def lives(unit: Unit, block: Callable[..., SampleBlock]) -> Lives:
    return Lives(unit, block)


@pytest.fixture
def hot(lives: Lives) -> Lives:
    """Hot oil, and a limit that is taken out of the plant file before the next start."""
    lives.take(0)
    lives.take(1, oil=70.0)
    lives.restart(NO_LIMIT)
    return lives


def test_an_alarm_whose_limit_is_gone_is_closed_and_can_be_acknowledged(hot):
    assert hot.events == [(OIL, "raised", "above_limit"), (OIL, "returned", "no_longer_watched")]
    assert hot.stored[OIL].state is AlarmState.RETURNED_UNACKNOWLEDGED

    hot.ask(OIL, Acknowledge("A. Name", 1))
    assert hot.stored[OIL].state is AlarmState.NORMAL


@pytest.mark.parametrize("is_measured_meanwhile", [True, False])
def test_one_that_was_closed_and_not_acknowledged_is_there_after_the_next_restart_too(
    hot, is_measured_meanwhile
):
    if is_measured_meanwhile:
        hot.take(2)
    hot.restart(NO_LIMIT)

    assert hot.changes(OIL) == ["raised", "returned"]
    hot.ask(OIL, Acknowledge("A. Name", 1))
    assert hot.changes(OIL) == ["raised", "returned", "acknowledged"]


def test_one_whose_limit_comes_back_is_judged_again(hot):
    hot.take(2)
    hot.restart(WATCHED)
    hot.take(3, oil=70.0)

    assert hot.changes(OIL) == ["raised", "returned", "raised"]
    assert (hot.stored[OIL].level, hot.stored[OIL].occurrence) == (AlarmLevel.ALERT, 2)


def test_a_link_that_was_lost_when_nothing_more_was_kept_stays_lost_until_samples_come(lives):
    lives.hear(True, 0)
    lives.take(1)
    lives.hear(False, 5, 16)
    for _ in range(2):
        lives.restart()
        lives.wait(20, 21, 99)
        assert lives.changes(LINK) == ["raised"]
        assert not lives.alarms.is_connected
    assert lives.events == [(LINK, "raised", "not connected")]
    lives.hear(True, 100, 101)
    assert lives.changes(LINK) == ["raised", "returned"]


def test_a_link_that_has_come_back_since_it_was_kept_as_lost_is_there(lives):
    lives.take(1)
    lives.hear(False, 2, 13)
    lives.memory = lives.alarms.memory
    lives.hear(True, 20)
    lives.restart()
    lives.wait(21, 22, 60)

    assert lives.changes(LINK) == ["raised", "returned"]
    assert lives.alarms.is_connected


def test_what_people_say_of_a_lost_link_holds_its_delay_neither_up_nor_off(lives):
    lives.take(1)
    lives.hear(False, 2, 8)
    lives.memory = lives.alarms.memory
    lives.ask(LINK, Comment("A. Name", "the cable"))
    lives.restart()
    lives.wait(11)
    assert lives.changes(LINK) == ["commented"]
    lives.wait(12)
    assert lives.changes(LINK) == ["commented", "raised"]
