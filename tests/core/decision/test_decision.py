"""What a decision says of healthy and of softened films, and when it says nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from core.alarms.alarm import AlarmLevel
from core.baseline.baseline import Watched
from core.decision.back_test import DecisionHistory, back_test
from core.decision.decision import UNDECIDED, Decision, release
from core.decision.limits import ChangeLimits
from core.decision.verdict import Verdict
from core.stiffness_history import Evidence, StiffnessHistory

LIMITS = ChangeLimits()
STIFFNESS = (Watched.STIFFNESS,)
LATER_H = 120 * 24.0
FilmLife = Callable[..., StiffnessHistory]


def loss(size: float, after_h: float = LATER_H + 20 * 24.0) -> Callable[[np.ndarray], np.ndarray]:
    return lambda hours: np.where(hours > after_h, np.log(1.0 - size), 0.0)


def spoil(history: StiffnessHistory, seed: int) -> StiffnessHistory:
    """Lose some readings, and let others come too soon."""
    random = np.random.default_rng(seed)
    lost = random.random(history.ln_k.shape) < 0.1
    evidence = np.where(lost, random.integers(1, 3, lost.shape), history.evidence).astype(np.int8)
    oil_c = np.where(random.random(len(history)) < 0.05, np.nan, history.oil_temperature_c)
    jitter_ns = random.integers(0, 590, len(history)) * 1_000_000_000
    return replace(
        history,
        time_ns=history.time_ns + jitter_ns,
        ln_k=np.where(lost, np.nan, history.ln_k),
        evidence=evidence,
        oil_temperature_c=oil_c,
    )


def assert_same(steps: list[Decision], whole: DecisionHistory) -> None:
    assert [int(step.verdict) for step in steps] == whole.verdict.tolist()
    assert [int(step.level or 0) for step in steps] == whole.level.tolist()
    changes = [np.nan if step.finding is None else step.finding.change for step in steps]
    np.testing.assert_allclose(changes, whole.change, rtol=1e-12)


@pytest.mark.parametrize("is_latching", [False, True])
@pytest.mark.parametrize("size", [0.05, 0.25])
def test_a_back_test_says_what_the_plant_would_have_said(
    film_life: FilmLife,
    watch: Callable[..., object],
    step_by_step: Callable[..., list[Decision]],
    size: float,
    is_latching: bool,
) -> None:
    def passing(hours: np.ndarray) -> np.ndarray:
        return loss(size)(hours) - loss(size, LATER_H + 30 * 24.0)(hours)

    limits = replace(LIMITS, is_latching=is_latching, off_delay_h=4.0)
    seen = watch(film_life(1, days=160, change=passing), STIFFNESS)
    later = spoil(seen.later, 3)
    whole = back_test(later, seen.is_settled, seen.stiffness_x, limits)
    assert_same(step_by_step(later, seen.is_settled, seen.stiffness_x, limits), whole)
    assert set(whole.verdict.tolist()) >= {
        *(Verdict.NORMAL, Verdict.ALERT, Verdict.NO_BASELINE, Verdict.TRANSIENT),
        *(Verdict.BAD_QUALITY, Verdict.INSUFFICIENT_EXCITATION, Verdict.GATHERING_EVIDENCE),
    }
    assert (whole.level[-1] == 0) is not is_latching


def test_a_healthy_film_raises_nothing(film_life: FilmLife, watch: Callable[..., object]) -> None:
    for seed in range(5):
        seen = watch(film_life(seed, days=300), STIFFNESS)
        found = back_test(seen.later, seen.is_settled, seen.stiffness_x, LIMITS)
        assert found.raised().size == 0
        assert np.mean(found.verdict == Verdict.NORMAL) > 0.7


@pytest.mark.parametrize(("size", "within_h"), [(0.2, 24.0), (0.1, 48.0), (0.05, 196.0)])
def test_a_softened_film_is_found_in_time(
    film_life: FilmLife, watch: Callable[..., object], size: float, within_h: float
) -> None:
    for seed in range(5):
        seen = watch(film_life(seed, days=160, change=loss(size)), STIFFNESS)
        found = back_test(seen.later, seen.is_settled, seen.stiffness_x, LIMITS)
        onset = int(
            np.searchsorted(seen.later.time_ns, seen.later.time_ns[0] + 20 * 86_400 * 10**9)
        )
        first = int(found.raised()[0])
        assert 0.0 <= (first - onset) / 6.0 <= within_h
        assert found.change[first] < -0.02


def test_a_large_loss_is_danger_and_a_rise_of_stiffness_is_found_too(
    film_life: FilmLife, watch: Callable[..., object]
) -> None:
    for size, sign in ((0.3, -1.0), (-0.3, 1.0)):
        seen = watch(film_life(1, days=140, change=loss(size, LATER_H + 24.0)), STIFFNESS)
        found = back_test(seen.later, seen.is_settled, seen.stiffness_x, LIMITS)
        assert found.level[-1] == AlarmLevel.DANGER
        assert np.sign(found.change[-1]) == sign


def test_the_deviation_of_a_softened_film_is_its_loss(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(1, days=140, change=loss(0.1, LATER_H)), STIFFNESS)
    newest = step_by_step(seen.later, seen.is_settled, seen.stiffness_x, LIMITS)[-1]
    assert newest.finding is not None
    assert newest.finding.change == pytest.approx(np.log(0.9), abs=0.02)


def test_spikes_raise_nothing(film_life: FilmLife, watch: Callable[..., object]) -> None:
    seen = watch(film_life(1, days=160), STIFFNESS)
    rows = np.arange(len(seen.later)) % 40
    spiky = replace(seen.later, ln_k=seen.later.ln_k - np.where(rows < 2, 1.5, 0.0))
    assert back_test(spiky, seen.is_settled, seen.stiffness_x, LIMITS).raised().size == 0


def test_nothing_is_decided_where_nothing_was_learned(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(1, days=140, change=loss(0.5, LATER_H)), STIFFNESS)
    elsewhere = replace(seen.later, oil_temperature_c=seen.later.oil_temperature_c + 60.0)
    found = back_test(elsewhere, seen.is_settled, seen.stiffness_x, LIMITS)
    assert set(found.verdict[seen.is_settled].tolist()) == {Verdict.NO_BASELINE}
    assert found.level.max() == 0
    without = step_by_step(seen.later.rows(0, 50), seen.is_settled, None, LIMITS)
    assert {w.verdict for w in without} <= {Verdict.NO_BASELINE, Verdict.TRANSIENT}


def test_standstills_gaps_and_unknown_readings_neither_add_nor_take_away(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(1, days=140, change=loss(0.1, LATER_H + 24.0)), STIFFNESS)
    before = step_by_step(seen.later.rows(0, 400), seen.is_settled, seen.stiffness_x, LIMITS)[-1]
    assert before.level is not None
    later_ns = seen.later.time_ns + 90 * 86_400 * 10**9
    idle = replace(
        seen.later,
        time_ns=later_ns,
        ln_k=np.full_like(seen.later.ln_k, np.nan),
        evidence=np.full_like(seen.later.evidence, Evidence.INSUFFICIENT_EXCITATION),
    )
    after = step_by_step(idle.rows(0, 300), seen.is_settled, seen.stiffness_x, LIMITS, before)[-1]
    assert after.verdict in (Verdict.INSUFFICIENT_EXCITATION, Verdict.TRANSIENT)
    assert (after.evidence, after.alert, after.danger) == (
        before.evidence,
        before.alert,
        before.danger,
    )
    assert after.level is before.level


def test_a_latched_level_stays_until_it_is_released(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    def passing(hours: np.ndarray) -> np.ndarray:
        return loss(0.2, LATER_H + 24.0)(hours) - loss(0.2, LATER_H + 96.0)(hours)

    limits = replace(LIMITS, is_latching=True)
    seen = watch(film_life(1, days=160, change=passing), STIFFNESS)
    baseline = replace(seen.stiffness_x, time_scatter=seen.stiffness_x.time_scatter[:1])
    steps = step_by_step(seen.later, seen.is_settled, baseline, limits)
    assert steps[-1].level is not None
    assert release(steps[-1], baseline, limits).level is None
    early = next(step for step in steps if step.level is not None)
    assert release(early, baseline, limits).level is early.level


def test_readings_that_come_too_often_count_once(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(1, days=140), STIFFNESS)
    often = replace(
        seen.later, time_ns=seen.later.time_ns[0] + np.arange(len(seen.later)) * 12 * 10**9
    )
    newest = step_by_step(often.rows(0, 250), np.ones(250, np.bool_), seen.stiffness_x, LIMITS)[-1]
    assert newest.evidence.n_counted <= 250 * 12 / 300 + 1


def test_time_cannot_stand_still(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(1, days=140), STIFFNESS)
    decision = replace(UNDECIDED, last_ns=int(seen.later.time_ns[0]))
    with pytest.raises(ValueError, match="is not after"):
        step_by_step(seen.later, seen.is_settled, seen.stiffness_x, LIMITS, decision)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("alert_change", 0.15),
        ("alert_change", float("nan")),
        ("danger_change", 0.0),
        ("deadband", 0.04),
        ("deadband", -0.01),
        ("significance", float("inf")),
        ("on_delay_h", 0.0),
    ],
)
def test_impossible_limits_are_refused_with_key_and_value(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{key} = {value:g}"):
        ChangeLimits(**{key: value})


def test_what_is_beyond_its_limit_but_has_not_lasted_yet_is_not_called_normal(
    film_life: FilmLife, watch: Callable[..., object], step_by_step: Callable[..., list[Decision]]
) -> None:
    seen = watch(film_life(3, days=150, change=loss(0.2)), STIFFNESS)
    said = step_by_step(seen.later, seen.is_settled, seen.stiffness_x, LIMITS)
    raised = next(i for i, decision in enumerate(said) if decision.level is not None)
    passed = [d for d in said[:raised] if d.alert.n_passed]
    assert passed
    assert Verdict.NORMAL not in {decision.verdict for decision in passed}
    assert said[0].verdict in (Verdict.TRANSIENT, Verdict.GATHERING_EVIDENCE)
