"""Changes of films, decided elsewhere, as alarms."""

from collections.abc import Mapping

import pytest

from core.alarms.alarm import AlarmLevel, AlarmState, Condition, unknown
from core.alarms.rules import UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.machine import Unit

FILM_X = "U1:UJB:stiffness_x"

LOST = Condition(AlarmLevel.ALERT, value=-0.21, limit=0.1, reason="film")


@pytest.fixture
def alarms(unit: Unit) -> UnitAlarms:
    return UnitAlarms(unit, UnitRules(films=rule_of(0.0, 0.0)))


def changes(alarms: UnitAlarms, conditions: Mapping[str, Condition], now_ns: int) -> list[str]:
    news = alarms.films(conditions, now_ns)
    return [event.change.value for told in news for event in told.events]


def test_films_have_an_alarm_in_each_direction_if_asked_for(alarms: UnitAlarms, unit: Unit) -> None:
    ids = [alarm.identity.id for alarm in alarms.alarms]
    assert [id_ for id_ in ids if "stiffness" in id_] == [FILM_X, "U1:UJB:stiffness_y"]
    unwatched = UnitAlarms(unit, UnitRules())
    assert not [a for a in unwatched.alarms if "stiffness" in a.identity.id]
    with pytest.raises(KeyError):
        unwatched.films({FILM_X: LOST}, 0)


def test_a_loss_of_stiffness_is_announced_at_once_with_its_size(alarms: UnitAlarms) -> None:
    [news] = alarms.films({FILM_X: LOST}, 7)

    [event] = news.events
    found = (event.change.value, event.value, event.limit, event.time_ns)
    assert found == ("raised", -0.21, 0.1, 7)


@pytest.mark.parametrize(
    "verdict", ["no_baseline", "insufficient_excitation", "bad_quality", "transient"]
)
def test_a_film_that_cannot_be_judged_stays_in_alarm_and_says_why(
    alarms: UnitAlarms, verdict: str
) -> None:
    changes(alarms, {FILM_X: LOST}, 0)

    assert changes(alarms, {FILM_X: unknown(verdict)}, 1) == ["condition_unknown"]
    alarm = alarms.alarm(FILM_X)
    assert (alarm.level, alarm.condition.reason) == (AlarmLevel.ALERT, verdict)


def test_a_film_that_was_never_judged_raises_nothing(alarms: UnitAlarms) -> None:
    assert changes(alarms, {FILM_X: unknown("no_baseline")}, 1) == []
    alarm = alarms.alarm(FILM_X)
    assert (alarm.state, alarm.condition.is_known) == (AlarmState.NORMAL, False)


def test_a_latched_loss_outlasts_the_healthy_verdict(unit: Unit) -> None:
    alarms = UnitAlarms(unit, UnitRules(films=rule_of(0.0, 0.0, is_latching=True)))
    changes(alarms, {FILM_X: LOST}, 0)

    assert changes(alarms, {FILM_X: Condition()}, 1) == ["latched"]
    assert alarms.alarm(FILM_X).level is AlarmLevel.ALERT
