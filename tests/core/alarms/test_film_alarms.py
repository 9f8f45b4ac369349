"""Changes of films and of 1× vectors as alarms."""

import math
from collections.abc import Mapping

import pytest

from core.alarms.alarm import AlarmIdentity, AlarmState
from core.alarms.judgements import OrderVector, VectorReference, vector_judgement
from core.alarms.kinds import Watch
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.condition.cells import NOWHERE_KNOWN
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement, Limits, unknown
from core.machine.unit import Unit
from core.quality import Reading, Reason, missing

FILM_X = "U1:UJB:stiffness_x"

LOST = Judgement(AlarmLevel.ALERT, value=-0.21, limit=0.1, reason="film")


@pytest.fixture
def alarms(unit: Unit) -> UnitAlarms:
    return UnitAlarms(unit, UnitRules(films=rule_of(0.0, 0.0)))


def changes(alarms: UnitAlarms, conditions: Mapping[str, Judgement], now_ns: int) -> list[str]:
    news = alarms.films(conditions, now_ns)
    return [event.change.value for told in news for event in told.events]


def test_films_have_an_alarm_in_each_direction_that_announces_a_loss_with_its_size(
    alarms: UnitAlarms, unit: Unit
) -> None:
    ids = [alarm.identity.id for alarm in alarms.alarms]
    assert [id_ for id_ in ids if "stiffness" in id_] == [FILM_X, "U1:UJB:stiffness_y"]
    unwatched = UnitAlarms(unit, UnitRules())
    assert not [a for a in unwatched.alarms if "stiffness" in a.identity.id]
    with pytest.raises(KeyError):
        unwatched.films({FILM_X: LOST}, 0)

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

    assert changes(alarms, {FILM_X: Judgement()}, 1) == ["latched"]
    assert alarms.alarm(FILM_X).level is AlarmLevel.ALERT


ALERT = AlarmLevel.ALERT
LIMITS = Limits(30.0, 60.0, 2.0)
NO_PHASE = missing(Reason.NOT_MEASURED)
WELL = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0, 10.0)})
LENGTH = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)})


def judged(
    found: Mapping[str, Reading],
    reference: VectorReference | None,
    held: AlarmLevel | None,
    place: str = "shaft_x",
) -> Judgement:
    rule = LimitRule(LIMITS, rule_of(0.0, 0.0))
    identity = AlarmIdentity("U1", "UJB", f"order1_change_{place}")
    watch = Watch(identity, rule.rule, place, limits=rule)
    return vector_judgement(found, watch, reference, NOWHERE_KNOWN, held)


def readings(amplitude: Reading | float, phase: Reading | float) -> dict[str, Reading]:
    found = {"order1_shaft_x_um_pk": amplitude, "order1_shaft_x_phase_deg": phase}
    return {n: r if isinstance(r, Reading) else Reading(r) for n, r in found.items()}


def test_a_vector_that_turns_either_way_is_noticed_though_its_length_stays() -> None:
    found = judged(readings(60.0, 70.0), WELL, None)

    assert found.value == pytest.approx(60.0)  # 60° of an equilateral triangle
    assert found.level is ALERT
    assert found.reason == "above_limit"
    almost = judged(readings(60.0, 350.0), WELL, None)

    assert almost.value == pytest.approx(2 * 60.0 * math.sin(math.radians(10.0)))


@pytest.mark.parametrize("reference", [WELL, LENGTH])
@pytest.mark.parametrize(("amplitude", "level"), [(80.0, None), (95.0, ALERT), (25.0, ALERT)])
def test_without_a_phase_only_the_length_counts_and_that_is_said(
    reference: VectorReference, amplitude: float, level: AlarmLevel | None
) -> None:
    found = judged(readings(amplitude, NO_PHASE), reference, None)

    assert (found.level, found.value) == (level, abs(amplitude - 60.0))
    assert found.reason.startswith("amplitude_change")


def test_without_a_reference_or_its_phase_nothing_is_known_and_standstill_suppresses() -> None:
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
def test_a_vector_is_made_of_numbers(vector: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must be a number"):
        OrderVector(*vector)
