"""What is stated of the uncertainty of stiffness from the amplitudes of a rack."""

import numpy as np
import pytest
from rigs.racks import K_B, blocks_of, polls, watch

from core.quality import Reason
from core.stiffness_budget import BEARING_GAIN, BRACKET, SHAFT_GAIN
from core.uncertainty import BearingAccuracy
from core.vector_budget import COHERENCE, SPREAD


def test_the_stated_random_part_is_true(rack) -> None:
    results = [
        watch(rack(), polls(60.0, 60.0, 20.0, 20.0, noise=0.05, seed=seed))[-1].readings
        for seed in range(60)
    ]
    k_eff = [readings["order1_k_eff_xx_n_per_m"] for readings in results]

    found = np.std([reading.value for reading in k_eff])
    stated = np.mean([reading.u_random for reading in k_eff])
    assert found == pytest.approx(stated, rel=0.3)


def test_transducers_bracket_and_the_unknown_coherence_are_the_systematic_part(rack) -> None:
    accuracy = BearingAccuracy(shaft_gain=0.03, bearing_gain=0.04, bracket_stiffness=0.1)
    monitor = rack(bearing={"accuracy": accuracy})
    newest = watch(monitor, polls(60.0, 60.0, 20.0, 20.0))[-1]

    budget = newest.budgets["order1_k_eff_xx_n_per_m"]
    share = {line.name: line.contribution / budget.value for line in budget.lines}
    third = 1.0 / np.sqrt(3.0)
    assert share[SHAFT_GAIN] == pytest.approx(0.03 * third)
    assert share[BEARING_GAIN] == pytest.approx(0.04 * third)
    assert share[BRACKET] == pytest.approx(0.1 * third)
    assert share[COHERENCE] == pytest.approx((1 / np.sqrt(0.9) - 1) * third)
    assert share[SPREAD] > 0.0


def test_a_rack_asked_more_often_than_it_measures_is_not_believed_more(rack) -> None:
    rng = np.random.default_rng(7)
    measured = np.array([[60.0], [60.0], [20.0], [20.0]]) * (1 + 0.05 * rng.normal(size=(4, 12)))
    often = watch(rack(), blocks_of(np.repeat(measured, 5, axis=1)))[-1]
    once = watch(rack(), blocks_of(measured))[-1]

    name = "order1_k_eff_xx_n_per_m"
    assert often.readings[name].value == pytest.approx(once.readings[name].value)
    assert often.readings[name].u_random == pytest.approx(once.readings[name].u_random, rel=0.05)


def test_a_rack_that_averages_longer_than_a_poll_is_not_believed_more(rack) -> None:
    """Each poll shows the mean of the last ten periods: neighbours share nine of them."""
    results = []
    for seed in range(60):
        each = np.random.default_rng(seed).normal(size=(4, 69))
        mean = np.array([np.convolve(row, np.full(10, 0.1), "valid") for row in each])
        values = np.array([[60.0], [60.0], [20.0], [20.0]]) * (1 + 0.1 * mean)
        results.append(watch(rack(), blocks_of(values))[-1].readings["order1_k_eff_xx_n_per_m"])

    found = np.std([reading.value for reading in results])
    stated = np.array([reading.u_random for reading in results])
    assert found / 1.5 < np.mean(stated) < 2.5 * found
    truth = 20.0 / 60.0 * K_B
    missed = [abs(r.value - truth) > 2.0 * u for r, u in zip(results, stated, strict=True)]
    assert sum(missed) <= 12


def test_a_rack_that_repeats_itself_is_doubted(rack) -> None:
    newest = watch(rack(), polls(60.0, 60.0, 20.0, 20.0, noise=0.0))[-1]

    assert newest.readings["order1_k_eff_xx_n_per_m"].quality.reason is Reason.FEW_SEGMENTS
