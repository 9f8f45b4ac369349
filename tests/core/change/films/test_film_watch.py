"""Films watched result by result: the same verdicts as over their whole history."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigs.tiers import first_fast

from core.baseline.history import ReadingOutcome
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import last_decision, last_operation, operation_history
from core.change.decision import JUDGED, Verdict
from core.change.film_judge import FilmFinding, FilmJudge, alarm_condition, unjudged
from core.change.film_reading import film_reading
from core.change.film_watch import FilmWatch
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from core.quality import Reading, Reason, missing, uncertain
from core.stiffness.estimators import as_ratios

S = 1_000_000_000


def loss(size: float, day: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda hours: np.where(hours > day * 24.0, np.log(1.0 - size), 0.0)


def test_a_restart_in_the_middle_changes_no_verdict(films, rules):
    history = films.later(change=loss(0.1, 106.0))
    through = films.watched(history)
    n = len(history) // 2
    first = films.watched(history.rows(0, n))

    after = films.watch(has_baseline=False)
    after.judge.activate_baseline("UJB", films.baseline, first[-1].decisions)
    operation, oil = last_operation(history.rows(n - 200, n), rules)
    after.restore_operation(operation, {"UJB": oil})
    second = films.watched(history.rows(n - 1, len(history)), after)

    assert [n.findings[0] for n in first + second] == [n.findings[0] for n in through]


def test_a_softer_film_is_an_alarm_though_its_damping_is_never_read(films):
    stiffness = films.baseline.quantities
    damping = tuple(replace(each, quantity=f"c{each.quantity}") for each in stiffness)
    watch = films.watch(has_baseline=False)
    learned = replace(films.baseline, quantities=(*stiffness, *damping))
    watch.judge.activate_baseline("UJB", learned)
    news = films.watched(films.later(change=loss(0.2, 106.0)), watch)
    assert news[-1].findings[0].level is not None


def test_a_baseline_of_stiffness_is_not_compared_with_ratios_to_an_unknown_bracket(films, rules):
    ratios = FilmWatch(rules, FilmJudge(rules, {"UJB": None}))
    ratios.judge.activate_baseline("UJB", films.baseline)
    assert ratios.judge.baseline("UJB") is None
    verdicts = {news.findings[0].verdict for news in films.watched(films.later(), ratios)}
    assert Verdict.NO_BASELINE in verdicts
    assert not verdicts & set(JUDGED)


@pytest.mark.long
def test_ratios_are_judged_by_a_baseline_of_ratios_as_stiffness_is(films, rules):
    [before, after] = films.life(3), films.later(change=loss(0.2, 106.0))
    in_ratios = [replace(h, ln_k=h.ln_k - math.log(1.18e9)) for h in (before, after)]
    n = int(np.searchsorted(before.time_ns, after.time_ns[0]))
    learning = in_ratios[0].rows(0, n)
    settled = operation_history(
        learning.time_ns, learning.speed_rpm, learning.power_mw, rules.operating
    ).is_settled
    baseline = learn(learning, settled, films.baseline.origin, BaselineSettings())
    watch = FilmWatch(rules, FilmJudge(rules, {"UJB": None}))
    watch.judge.activate_baseline("UJB", baseline)
    found = []
    for result in films.results(in_ratios[1]):
        found += watch.take([replace(result, readings=as_ratios(result.readings))])[1]
    wanted = films.watched(after)
    assert [f.findings[0].level for f in found] == [f.findings[0].level for f in wanted]
    deviations = [
        [np.nan if f.findings[0].deviation is None else f.findings[0].deviation for f in each]
        for each in (found, wanted)
    ]
    np.testing.assert_allclose(*deviations, atol=1e-6)
    assert found[-1].findings[0].level is not None


@pytest.mark.long
def test_decisions_caught_up_with_are_those_that_would_have_been_made(films, rules):
    history = films.later()
    made = films.watched(history)
    settled = np.array([n.reading.condition.is_settled for n in made])
    for row, direction in enumerate("xy"):
        learned = films.baseline.of(f"k_{direction}")
        caught = last_decision(history.rows(1, len(history)), settled, learned, rules)
        through = made[-1].decisions[row]
        assert (caught.verdict, caught.level) == (through.verdict, through.level)
        assert caught.evidence.n_counted == through.evidence.n_counted
        assert caught.finding is not None
        assert through.finding is not None
        assert caught.finding.change == pytest.approx(through.finding.change, rel=1e-9)


def test_without_a_baseline_nothing_is_called_normal(films):
    news = films.watched(films.life(3, days=2), films.watch(has_baseline=False))
    verdicts = {finding.verdict for told in news for finding in told.findings}
    assert verdicts == {Verdict.NO_BASELINE, Verdict.TRANSIENT, Verdict.BAD_QUALITY}  # no damping


def test_readings_are_as_far_apart_as_they_should_be_however_often_results_come(films):
    watch = films.watch(has_baseline=False)
    times = [1_000_000 * S + i * 12 * S for i in range(500)]
    found = [watch.take([films.assessment(time_ns)])[1] for time_ns in times]
    marks = [news[0].reading.time_ns for news in found if news]
    assert len(marks) == 500 * 12 // 600
    assert all(time_ns // (600 * S) != (time_ns - 12 * S) // (600 * S) for time_ns in marks)


@pytest.mark.parametrize("back_s", first_fast(2, [300, 400 * 86_400, 3 * 3600]))
def test_a_clock_that_is_put_back_stops_neither_operation_nor_readings(films, back_s):
    history, watch = films.later(), films.watch()
    films.watched(history.rows(0, 60), watch)
    again = replace(history, time_ns=history.time_ns - back_s * S).rows(60, 400)

    news = films.watched(again, watch)

    assert len(news) >= 330
    assert news[-1].findings[0].verdict in (*JUDGED, Verdict.TRANSIENT)
    assert any(told.findings[0].verdict in JUDGED for told in news)


def test_doubtful_numbers_are_no_numbers(films, rules):
    good = {
        "eccentricity_ratio": Reading(0.4),
        "oil_temperature_c": Reading(45.0),
        "dynamic_k_xx_n_per_m": Reading(0.5e9, u_random=0.01e9),
        "dynamic_k_yy_n_per_m": Reading(0.5e9, uncertain(Reason.LOW_COVERAGE), u_random=0.01e9),
    }
    condition = films.watch(has_baseline=False).take([films.assessment(**good)])[0][0].condition
    assert condition is not None
    x, y = film_reading(films.assessment(**good), condition, rules.estimators["UJB"]).values
    assert (x.outcome, x.ln_k, x.u_random) == (ReadingOutcome.MEASURED, np.log(0.5e9), 0.02)
    assert (y.outcome, y.reason) == (ReadingOutcome.BAD_QUALITY, Reason.LOW_COVERAGE)
    assert np.isnan(y.ln_k)

    cold = good | {"oil_temperature_c": missing(Reason.OUT_OF_RANGE)}
    x, _ = film_reading(films.assessment(**cold), condition, rules.estimators["UJB"]).values
    assert (x.outcome, x.reason) == (ReadingOutcome.BAD_QUALITY, Reason.OUT_OF_RANGE)

    still = good | {"dynamic_k_xx_n_per_m": missing(Reason.INSUFFICIENT_EXCITATION)}
    x, _ = film_reading(films.assessment(**still), condition, rules.estimators["UJB"]).values
    assert x.outcome is ReadingOutcome.INSUFFICIENT_EXCITATION

    soft = good | {"dynamic_k_xx_n_per_m": Reading(-1e6, u_random=1e6)}
    x, _ = film_reading(films.assessment(**soft), condition, rules.estimators["UJB"]).values
    assert x.outcome is ReadingOutcome.BAD_QUALITY


def test_results_say_the_condition_that_they_were_found_under(films):
    known = {
        "speed_rpm": Reading(92.3),
        "power_mw": Reading(200.0),
        "eccentricity_ratio": Reading(0.42),
        "oil_temperature_c": Reading(46.0),
    }
    watch = films.watch(has_baseline=False)
    [first], _ = watch.take([films.assessment(10**18, **known)])
    for i in range(1, 62):
        [last], _ = watch.take([films.assessment(10**18 + i * 60 * S, **known)])
    lost = known | {"eccentricity_ratio": missing(Reason.DEAD)}
    [blind], _ = watch.take([films.assessment(10**18 + 4000 * S, **lost)])

    assert first.condition is not None
    assert last.condition is not None
    assert blind.condition is not None
    assert (first.condition.state, first.condition.is_settled) == (OperatingState.PART_LOAD, False)
    assert (last.condition.is_settled, last.condition.cell) == (True, (8, 18))
    assert blind.condition.cell is None


def condition_in_x(*own: FilmFinding) -> Judgement:
    """What an alarm says of findings in x; damping is not judged unless given."""
    found = {each.quantity: each for each in (*unjudged(Verdict.NO_BASELINE), *own)}
    return alarm_condition(tuple(found.values()), "x")


@pytest.mark.parametrize("verdict", [v for v in Verdict if v not in JUDGED])
def test_what_is_not_judged_is_neither_an_alarm_nor_a_return(verdict):
    held = FilmFinding(verdict, AlarmLevel.ALERT, -0.1, 0.01, 4.0)
    condition = condition_in_x(held)
    assert not condition.is_known
    assert condition.reason == verdict.name.lower()


def test_an_alarm_says_by_how_much_and_which_limit(rules):
    alert = condition_in_x(FilmFinding(Verdict.ALERT, AlarmLevel.ALERT, -0.1))
    limit = rules.change.danger_change
    danger = condition_in_x(FilmFinding(Verdict.DANGER, AlarmLevel.DANGER, 0.3, limit=limit))
    assert (alert.level, alert.limit) == (1, pytest.approx(-100.0 * rules.change.alert_change))
    assert (danger.level, danger.limit) == (2, pytest.approx(100.0 * rules.change.danger_change))
    assert alert.value == pytest.approx(100.0 * (math.exp(-0.1) - 1.0))
    assert danger.value == pytest.approx(100.0 * (math.exp(0.3) - 1.0))
    assert condition_in_x(FilmFinding(Verdict.NORMAL)).level is None


def test_an_alarm_is_about_the_quantity_that_is_furthest_beyond_its_limit():
    softer = FilmFinding(Verdict.ALERT, AlarmLevel.ALERT, -0.05)
    damped = replace(softer, change=0.02, quantity="ck_x", limit=0.005)
    assert condition_in_x(softer, damped).limit == pytest.approx(0.5)
    assert condition_in_x(FilmFinding(Verdict.NORMAL), damped).value == pytest.approx(
        2.02, abs=0.01
    )
    assert not condition_in_x(FilmFinding(Verdict.TRANSIENT)).is_known


def test_damping_that_is_not_judged_holds_its_alarm_but_hinders_no_verdict():
    silent = FilmFinding(Verdict.BAD_QUALITY, quantity="ck_x")
    assert condition_in_x(FilmFinding(Verdict.NORMAL), silent).is_known
    held = replace(silent, level=AlarmLevel.DANGER)
    assert not condition_in_x(FilmFinding(Verdict.NORMAL), held).is_known
    softer = FilmFinding(Verdict.ALERT, AlarmLevel.ALERT, -0.05)
    assert condition_in_x(softer, held).level is AlarmLevel.DANGER


@pytest.mark.long
def test_time_that_passes_faster_asks_for_fewer_hours(films, rules):
    history = films.later(change=loss(0.2, 106.0))
    start_ns = int(history.time_ns[0])
    fast_ns = start_ns + (history.time_ns - start_ns) // 50
    fast = replace(rules, reading_ns=12 * S, time_lapse=50.0)

    slow_news = films.watched(history)
    fast_news = films.watched(replace(history, time_ns=fast_ns), films.watch(fast))

    levels = [[n.findings[0].level for n in news] for news in (slow_news, fast_news)]
    raised = [found.index(AlarmLevel.ALERT) for found in levels]
    assert abs(raised[0] - raised[1]) <= 3
