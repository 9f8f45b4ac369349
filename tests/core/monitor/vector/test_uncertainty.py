"""What phases and uncertainty add to the amplitudes of a rack."""

import numpy as np
import pytest
from rigs.blocks import with_quality
from rigs.racks import AMPLITUDES, K_B, PHASES, blocks_of, polls, watch

from core.machine.unit import BearingAccuracy
from core.quality import GOOD, Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.spectra.segments import Evidence
from core.stiffness.stiffness_budget import BEARING_GAIN, BRACKET, COHERENCE, SPREAD
from core.uncertainty import SHAFT_GAIN


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


def test_a_rack_that_repeats_itself_or_is_asked_too_often_is_not_believed_more(rack) -> None:
    rng = np.random.default_rng(7)
    measured = np.array([[60.0], [60.0], [20.0], [20.0]]) * (1 + 0.05 * rng.normal(size=(4, 12)))
    often = watch(rack(), blocks_of(np.repeat(measured, 5, axis=1)))[-1]
    once = watch(rack(), blocks_of(measured))[-1]

    name = "order1_k_eff_xx_n_per_m"
    assert often.readings[name].value == pytest.approx(once.readings[name].value)
    assert often.readings[name].u_random == pytest.approx(once.readings[name].u_random, rel=0.05)

    newest = watch(rack(), polls(60.0, 60.0, 20.0, 20.0, noise=0.0))[-1]

    assert newest.readings["order1_k_eff_xx_n_per_m"].quality.reason is Reason.FEW_SEGMENTS


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


FILM = 0.5e9 + 1j * 0.04e9


def vectors(noise_deg: float = 0.0, n: int = 60) -> list[SampleBlock]:
    """A forward circle of the shaft; the bearing follows through the film: X_b = U·k/k_b."""
    bearing = FILM / K_B * 60.0
    angle = np.rad2deg(np.angle(bearing))
    rows = np.array([60.0, 60.0, abs(bearing), abs(bearing), 40.0, -50.0, 40 + angle, angle - 50])
    rng = np.random.default_rng(3)
    values = np.repeat(rows[:, np.newaxis], n, axis=1)
    values[:4] *= 1 + 0.001 * rng.normal(size=(4, n))
    values[4:] += noise_deg * rng.normal(size=(4, n))
    return blocks_of(values)


def test_with_phases_stiffness_and_damping_are_told_apart(rack) -> None:
    newest = watch(rack(AMPLITUDES + PHASES), vectors(noise_deg=0.5))[-1]

    omega = 2 * np.pi * 92.3 / 60
    k = newest.readings["order1_transfer_k_xx_n_per_m"]
    c = newest.readings["order1_transfer_c_yy_n_s_per_m"]
    assert k.value == pytest.approx(FILM.real, rel=2e-3)
    assert c.value * omega == pytest.approx(FILM.imag, rel=0.05)
    assert k.u_random is not None
    assert newest.readings["order1_roundness"].value == pytest.approx(1.0, abs=1e-3)
    assert newest.readings["order1_coherence_xx"] == missing(Reason.NOT_MEASURED)
    assert newest.evidence is Evidence.AMPLITUDE_AND_PHASE
    assert newest.estimators == {"xx": "transfer_order1", "yy": "transfer_order1"}


def test_vectors_that_do_not_hang_together_or_are_exchanged_are_doubted(rack) -> None:
    newest = watch(rack(AMPLITUDES + PHASES), vectors(noise_deg=60.0))[-1]

    for name in ("order1_k_eff_xx_n_per_m", "order1_transfer_k_xx_n_per_m"):
        assert newest.readings[name] == missing(Reason.INSUFFICIENT_EXCITATION)

    monitor = rack(AMPLITUDES + PHASES, rotation_sense=-1)
    newest = watch(monitor, vectors())[-1]

    assert newest.readings["stiffness_xx_n_per_m"].quality.reason is Reason.SWAPPED_AXES


def test_a_phase_that_is_bad_is_no_phase(rack) -> None:
    blocks = [with_quality(b, (GOOD,) * 6 + (bad(Reason.SENSOR_FAILURE),) * 2) for b in vectors()]
    newest = watch(rack(AMPLITUDES + PHASES), blocks)[-1]

    assert newest.readings["order1_transfer_k_xx_n_per_m"] == missing(Reason.NOT_MEASURED)
    assert newest.readings["order1_k_eff_xx_n_per_m"].value is not None
    assert newest.evidence is Evidence.AMPLITUDE_ONLY
