"""What a decision says of healthy and of softened films, and when it says nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigs.tiers import first_fast

from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.change.backtest import DecisionHistory
from core.change.decision import INITIAL_DECISION, Decision, Verdict
from core.change.settings import ChangeLimits
from core.limits import AlarmLevel

LIMITS = ChangeLimits()
LATER_H = 120 * 24.0


def loss(size: float, after_h: float = LATER_H + 20 * 24.0) -> Callable[[np.ndarray], np.ndarray]:
    return lambda hours: np.where(hours > after_h, np.log(1.0 - size), 0.0)


def passing(size: float, from_h: float, to_h: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda hours: loss(size, LATER_H + from_h)(hours) - loss(size, LATER_H + to_h)(hours)


def spoil(history: StiffnessHistory, seed: int) -> StiffnessHistory:
    """Lose some readings, and let others come too soon."""
    random = np.random.default_rng(seed)
    lost = random.random(history.ln_k.shape) < 0.1
    outcome = np.where(lost, random.integers(1, 3, lost.shape), history.outcome).astype(np.int8)
    oil_c = np.where(random.random(len(history)) < 0.05, np.nan, history.oil_temperature_c)
    jitter_ns = random.integers(0, 590, len(history)) * 1_000_000_000
    return replace(
        history,
        time_ns=history.time_ns + jitter_ns,
        ln_k=np.where(lost, np.nan, history.ln_k),
        outcome=outcome,
        oil_temperature_c=oil_c,
    )


def assert_same(steps: list[Decision], whole: DecisionHistory) -> None:
    assert [int(step.verdict) for step in steps] == whole.verdict.tolist()
    assert [int(step.level or 0) for step in steps] == whole.level.tolist()
    changes = [np.nan if step.finding is None else step.finding.change for step in steps]
    np.testing.assert_allclose(changes, whole.change, rtol=1e-12)


@pytest.mark.parametrize("size", first_fast(1, [0.05, 0.25]))
def test_a_back_test_says_what_the_plant_would_have_said(watch, size):
    limits = replace(LIMITS, off_delay_h=4.0)
    seen = watch(1, days=160, change=passing(size, 20 * 24.0, 30 * 24.0))
    spoilt = replace(seen, later=spoil(seen.later, 3))
    whole = spoilt.whole(limits)
    assert_same(spoilt.steps(limits), whole)
    assert set(whole.verdict.tolist()) >= {
        *(Verdict.NORMAL, Verdict.ALERT, Verdict.NO_BASELINE, Verdict.TRANSIENT),
        *(Verdict.BAD_QUALITY, Verdict.INSUFFICIENT_EXCITATION, Verdict.GATHERING_EVIDENCE),
    }
    assert whole.level[-1] < whole.level.max()


@pytest.mark.parametrize("n_seeds", first_fast(1, [2, 8]))
def test_a_healthy_film_raises_nothing(watch, n_seeds):
    for seed in range(n_seeds):
        found = watch(seed, days=300).whole()
        assert not found.level.any()
        assert np.mean(found.verdict == Verdict.NORMAL) > 0.7


@pytest.mark.parametrize("n_seeds", first_fast(1, [2, 8]))
@pytest.mark.parametrize(("size", "within_h"), [(0.2, 24.0), (0.1, 48.0), (0.05, 196.0)])
def test_a_softened_film_is_found_in_time(watch, size, within_h, n_seeds):
    for seed in range(n_seeds):
        seen = watch(seed, days=160, change=loss(size))
        found, time_ns = seen.whole(), seen.later.time_ns
        onset = int(np.searchsorted(time_ns, time_ns[0] + 20 * 86_400 * 10**9))
        first = int(np.flatnonzero(found.level)[0])
        assert 0.0 <= (first - onset) / 6.0 <= within_h
        assert found.change[first] < -0.02


@pytest.mark.long
def test_a_large_loss_is_danger_with_its_size_and_a_rise_of_stiffness_is_found_too(watch):
    for size, sign in ((0.3, -1.0), (-0.3, 1.0)):
        found = watch(1, change=loss(size, LATER_H + 24.0)).whole()
        assert found.level[-1] == AlarmLevel.DANGER
        assert np.sign(found.change[-1]) == sign
    newest = watch(1, change=loss(0.1, LATER_H)).steps()[-1]
    assert newest.finding is not None
    assert newest.finding.change == pytest.approx(np.log(0.9), abs=0.02)


@pytest.mark.parametrize(
    ("size", "lasting_std", "most"), [(0.03, 0.02, 0), (0.1, 0.03, AlarmLevel.ALERT)]
)
def test_a_level_is_reached_only_by_a_change_beyond_its_own_limit(watch, size, lasting_std, most):
    """Films whose deviations last for half a day, by 2 or 3 %."""
    for seed in (1, 2):
        seen = watch(seed, days=240, lasting_std=lasting_std, change=loss(size, LATER_H + 24.0))
        assert seen.whole().level.max() == most


def test_spikes_raise_nothing_and_where_nothing_was_learned_nothing_is_decided(watch):
    seen = watch(1, days=160)
    rows = np.arange(len(seen.later)) % 40
    spiky = replace(seen.later, ln_k=seen.later.ln_k - np.where(rows < 2, 1.5, 0.0))
    assert not replace(seen, later=spiky).whole().level.any()
    seen = watch(1, change=loss(0.5, LATER_H))
    elsewhere = replace(seen.later, oil_temperature_c=seen.later.oil_temperature_c + 60.0)
    found = replace(seen, later=elsewhere).whole()
    assert set(found.verdict[seen.is_settled].tolist()) == {Verdict.NO_BASELINE}
    assert found.level.max() == 0
    without = replace(seen.first(50), baseline=None).steps()
    assert {w.verdict for w in without} <= {Verdict.NO_BASELINE, Verdict.TRANSIENT}


def test_standstills_gaps_and_unknown_readings_neither_add_nor_take_away(watch):
    seen = watch(1, change=loss(0.1, LATER_H + 24.0))
    before = seen.first(400).steps()[-1]
    assert before.level is not None
    idle = replace(
        seen.later,
        time_ns=seen.later.time_ns + 90 * 86_400 * 10**9,
        ln_k=np.full_like(seen.later.ln_k, np.nan),
        outcome=np.full_like(seen.later.outcome, ReadingOutcome.INSUFFICIENT_EXCITATION),
    )
    after = replace(seen, later=idle).first(300).steps(begin=before)[-1]
    assert after.verdict in (Verdict.INSUFFICIENT_EXCITATION, Verdict.TRANSIENT)
    for part in ("evidence", "alert", "danger", "level"):
        assert getattr(after, part) == getattr(before, part)


def test_readings_that_come_too_often_count_once_and_time_cannot_stand_still(watch):
    seen = watch(1).first(250)
    often = replace(seen.later, time_ns=seen.later.time_ns[0] + np.arange(250) * 12 * 10**9)
    newest = replace(seen, later=often, is_settled=np.ones(250, np.bool_)).steps()[-1]
    assert newest.evidence.n_counted <= 250 * 12 / 300 + 1
    seen = watch(1)
    with pytest.raises(ValueError, match="must be after"):
        seen.steps(begin=replace(INITIAL_DECISION, last_ns=int(seen.later.time_ns[0])))


def test_what_is_beyond_its_limit_but_has_not_lasted_yet_is_not_called_normal(watch):
    said = watch(3, days=150, change=loss(0.2)).steps()
    raised = next(i for i, decision in enumerate(said) if decision.level is not None)
    passed = [d for d in said[:raised] if d.alert.opposed_ns]
    assert passed
    assert Verdict.NORMAL not in {decision.verdict for decision in passed}
    assert said[0].verdict in (Verdict.TRANSIENT, Verdict.GATHERING_EVIDENCE)
