"""Films are read back from the store as they were written, and nothing written is changed."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields, replace

import numpy as np
import pytest

from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import QUANTITIES, StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.cause import Attribution, Cause
from core.change.decision import Decision, Verdict
from core.change.evidence import Finding, GatheredEvidence, ScaleSums
from core.change.film_judge import FilmFinding
from core.change.shaft_response import learn_response
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.machine.unit import Estimator
from service.store.baselines import BaselineStep, StoredStep
from service.store.film_readings import FilmQuery
from service.store.port import StoreError, ValueRange

FilmLife = Callable[..., StiffnessHistory]
DECISION = Decision(
    Verdict.ALERT,
    Finding(4.0, -0.1, 0.01),
    -0.12,
    0.02,
    GatheredEvidence(7, scales=(ScaleSums(0.5, 0.4, -0.1 - 1e-17, 0.2, 1 / 3),)),
    last_ns=5,
    last_counted_ns=4,
)
FOUND = FilmFinding(
    *(Verdict.ALERT, AlarmLevel.ALERT, -0.1, 0.01, 4.0, -0.12, 0.02, 3),
    Attribution(Cause.FILM, "the shaft moves as it does with softer films"),
)


def findings(*own: FilmFinding) -> tuple[FilmFinding, ...]:
    """The findings as those on the first quantities, and of the rest that it is normal."""
    return tuple(
        replace(own[n] if n < len(own) else FilmFinding(Verdict.NORMAL), quantity=name)
        for n, name in enumerate(QUANTITIES)
    )


def query(**changes: object) -> FilmQuery:
    return replace(FilmQuery("U1", "UJB", Estimator.DYNAMIC), **changes)  # type: ignore[arg-type]


def test_readings_are_read_back_to_the_last_bit(store, film_news, film_life):
    history = film_life(2, days=3)
    ln_k = history.ln_k.copy()
    ln_k[0, 5] = np.nan
    outcome = np.where(np.isnan(ln_k), 2, 0).astype(np.int8)
    history = replace(history, ln_k=ln_k, outcome=outcome)
    news = film_news(history)
    news[7] = replace(
        news[7], findings=findings(FOUND, FilmFinding(Verdict.NORMAL, baseline_version=3))
    )

    store.append([], [], [], news)
    found = store.films.history(query())

    for column in fields(StiffnessHistory):
        written, read = getattr(history, column.name), getattr(found.history, column.name)
        if column.name == "u_random":
            written = np.where(np.isnan(ln_k), read, written)
        np.testing.assert_array_equal(written, read, column.name)
    assert found.is_settled.tolist() == [n.reading.condition.is_settled for n in news]
    assert found.state.tolist() == [n.reading.condition.state for n in news]
    assert found.verdict[:, 7].tolist() == [Verdict.ALERT] + 3 * [Verdict.NORMAL]
    assert found.level[:, 7].tolist() == [1, 0, 0, 0]
    assert (found.change[0, 7], found.deviation_std[0, 7]) == (-0.1, 0.02)
    assert found.baseline_version[[6, 7]].tolist() == [0, 3]
    assert not found.is_simulated.any()
    assert store.films.first_ns("U1", "UJB", Estimator.DYNAMIC) == history.time_ns[0]
    assert store.films.first_ns("U1", "LJB", Estimator.DYNAMIC) is None


def test_readings_are_picked_by_time_state_and_condition(store, film_news, film_life):
    history = film_life(2, days=3)
    store.append([], [], [], film_news(history))
    e, oil, time_ns = history.eccentricity_ratio, history.oil_temperature_c, history.time_ns

    inside = query(
        start_ns=int(time_ns[10]),
        end_ns=int(time_ns[200]),
        eccentricity_ratio=ValueRange(0.3, 0.45),
        oil_temperature_c=ValueRange(30.0, None),
    )
    wanted = (e >= 0.3) & (e <= 0.45) & (oil >= 30.0)
    wanted &= (time_ns >= time_ns[10]) & (time_ns < time_ns[200])
    assert store.films.history(inside).history.time_ns.tolist() == time_ns[wanted].tolist()

    full = store.films.history(query(states=(OperatingState.FULL_LOAD,)))
    assert 0 < len(full) < len(history)
    assert set(full.state.tolist()) == {OperatingState.FULL_LOAD}
    newest = store.films.history(query(newest=3))
    assert newest.history.time_ns.tolist() == time_ns[-3:].tolist()
    assert len(store.films.history(query(estimator=Estimator.RATIO_ORDER1))) == 0


def test_readings_written_twice_count_once_and_simulated_stay_marked(store, film_news, film_life):
    news = film_news(film_life(2, days=1))
    store.films.add_simulated(news[:40])
    store.append([], [], [], news)
    store.append([], [], [], news)
    assert store.films.history(query()).is_simulated.tolist() == [i < 40 for i in range(len(news))]


def test_decisions_go_on_where_they_stood(store, film_news, film_life):
    first, second, *_ = film_news(film_life(2, days=1))
    store.append([], [], [], [replace(first, findings=findings(FOUND))])
    store.append(
        [], [], [], [replace(second, decisions=(DECISION,) * 4, findings=findings(*[FOUND] * 4))]
    )

    x, *others = store.films.decisions("U1", "UJB")
    assert [each.quantity for each in (x, *others)] == list(QUANTITIES)
    assert {each.decision for each in (x, *others)} == {DECISION}
    assert (x.baseline_version, x.estimator) == (3, Estimator.DYNAMIC)
    assert store.films.decisions("U1", "LJB") == []


@pytest.fixture(scope="module")
def baseline(film_life: FilmLife) -> BearingBaseline:
    history = film_life(2, days=40)
    origin = Origin("U1", "UJB", "dynamic", 1, "Ada", 77, "overhaul")
    return learn(history, np.ones(len(history), bool), origin, BaselineSettings())


STEP = StoredStep("U1", "UJB", 1, BaselineStep.ACCEPTED, 78, "Ada", "looks right")


def test_baselines_and_what_was_done_to_them_are_read_back_as_written_once(store, baseline):
    renewed = StoredStep("U1", "UJB", None, BaselineStep.RENEWED, 80, "Bo", "overhaul", 79)
    for _ in range(2):  # again where nobody can tell whether it was written
        store.films.add_baseline(baseline, [STEP])
    store.films.add_steps([renewed])

    assert store.films.baseline("U1", "UJB", 1) == baseline
    assert store.films.baseline("U1", "UJB", 2) is None
    [entry] = store.films.baselines("U1", "UJB")
    found = (entry.version, entry.author, entry.event, entry.created_ns, entry.estimator)
    assert found == (1, "Ada", "overhaul", 77, Estimator.DYNAMIC)
    assert store.films.steps("U1", "UJB") == [STEP, renewed]
    assert store.films.steps("U1", "LJB") == []


def test_a_version_is_written_once(store, baseline):
    store.films.add_baseline(baseline, [])
    with pytest.raises(StoreError, match="UNIQUE"):
        store.films.add_baseline(baseline, [STEP])
    assert store.films.steps("U1", "UJB") == []


def test_no_baseline_is_ever_changed_or_taken_away(store, baseline, tmp_path):
    store.films.add_baseline(baseline, [STEP])
    with closing(sqlite3.connect(tmp_path / "padwatch.sqlite3")) as connection:
        for statement in (
            "UPDATE baseline SET author = 'Eve'",
            "DELETE FROM baseline",
            "UPDATE baseline_step SET reason = ''",
            "DELETE FROM baseline_step",
        ):
            with pytest.raises(sqlite3.IntegrityError, match="kept"):
                connection.execute(statement)


def test_a_baseline_that_makes_no_sense_is_refused_by_name(store, baseline):
    store.films.add_baseline(baseline, [])
    writer = store._writer
    writer.execute("DROP TRIGGER baseline_kept_as_learned")
    writer.execute("UPDATE baseline SET document = replace(document, 'knot', 'kn0t')")
    writer.execute("UPDATE baseline SET document = substr(document, 1, 5000)")
    with pytest.raises(StoreError, match="baseline 1 of unit U1 bearing UJB"):
        store.films.baseline("U1", "UJB", 1)


def test_the_response_of_a_shaft_is_read_back(store, film_life):
    history = film_life(2, days=60)
    response = learn_response({"UJB": history}, np.ones(len(history), bool))
    assert response is not None
    store.films.set_response("U1", response, 1)
    store.films.set_response("U1", response, 2)
    assert store.films.responses() == {"U1": response}
