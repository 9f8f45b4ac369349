"""Stiffness at one line: real part and imaginary part of one complex ratio."""

import math

import numpy as np
import pytest

from core.arrays import ComplexArray
from core.machine.unit import BearingAccuracy, BracketDynamics
from core.quality import Reason
from core.spectra.cross_spectrum import BEARING_X, SHAFT_X, CrossSpectrum, average
from core.stiffness.evidence import line_excitation
from core.stiffness.stiffness_budget import effective_stiffness_n_per_m, transfer_budgets
from core.uncertainty import Budget

FREQUENCY_HZ = np.array([1.54])
OMEGA = 2.0 * math.pi * 1.54
BRACKET = BracketDynamics(1.18e9, 0.45e5, 2.0e5)
K_N_PER_M, C_N_S_PER_M = 0.5e9, 6.25e6


def spectrum(phasors: ComplexArray) -> CrossSpectrum:
    return average(FREQUENCY_HZ, phasors, np.ones(phasors.shape[:2], dtype=bool))


def motion(
    seed: int = 1, n_segments: int = 24, noise_um: float = 0.0, probe_um: float = 0.0
) -> ComplexArray:
    """Shaft and bearing phasors (n_segments, 4, 1) of a film without cross-coupling."""
    rng = np.random.default_rng(seed)
    phase = np.exp(2j * np.pi * rng.uniform(size=(n_segments, 1, 1)))
    shaft = phase * np.array([[10.0], [-10.0j]])
    film = (K_N_PER_M + 1j * OMEGA * C_N_S_PER_M) / BRACKET.dynamic_stiffness_n_per_m(FREQUENCY_HZ)
    noise = rng.normal(size=(2, n_segments, 2, 1)) + 1j * rng.normal(size=(2, n_segments, 2, 1))
    bearing = film * shaft + noise_um * noise[0]
    return np.concatenate([shaft + probe_um * noise[1], bearing], axis=1)


def transfer(
    phasors: ComplexArray, bracket: BracketDynamics = BRACKET
) -> tuple[Budget, Budget] | None:
    return transfer_budgets(spectrum(phasors), 0, SHAFT_X, BEARING_X, bracket, BearingAccuracy())


def found(phasors: ComplexArray, bracket: BracketDynamics = BRACKET) -> tuple[Budget, Budget]:
    result = transfer(phasors, bracket)
    assert result is not None
    return result


def test_stiffness_is_the_real_part_and_damping_the_imaginary_part_if_there_is_motion():
    k, c = found(motion())

    assert k.value == pytest.approx(K_N_PER_M, rel=1e-12)
    assert c.value == pytest.approx(C_N_S_PER_M, rel=1e-12)
    assert k.random == pytest.approx(0.0, abs=1e3)

    still = motion()
    still[:, 0] = 0.0
    assert transfer(still) is None
    assert transfer(motion(n_segments=1)) is None


def test_leaving_the_brackets_inertia_out_reads_what_equation_5_reads_and_is_stated():
    massless, _ = found(motion(), BracketDynamics(BRACKET.stiffness_n_per_m))

    # m_b ω² / k_b = 0.36 % at rated speed (UJB)
    assert massless.value / K_N_PER_M == pytest.approx(1.0036, abs=0.0003)

    before, _ = found(motion())
    after, _ = found(motion(), BracketDynamics(1.01 * 1.18e9, 0.45e5, 2.0e5))

    [of_bracket] = (line for line in before.lines if line.name == "bracket stiffness")
    assert after.value - before.value == pytest.approx(0.01 * of_bracket.sensitivity, rel=1e-9)


def test_bearing_noise_does_not_raise_the_stiffness_as_it_raises_an_amplitude():
    many = motion(n_segments=20_000, noise_um=2.0)

    assert found(many)[0].value == pytest.approx(K_N_PER_M, rel=0.01)
    ratio = spectrum(many).amplitude_ratio(BEARING_X, SHAFT_X)[0] * BRACKET.stiffness_n_per_m
    assert ratio > 1.1 * K_N_PER_M


@pytest.mark.parametrize("n_segments", [3, 24])
def test_the_stated_uncertainty_is_the_scatter(n_segments):
    results = [found(motion(seed, n_segments, noise_um=0.5)) for seed in range(400)]

    for budgets in zip(*results, strict=True):
        scatter = np.std([budget.value for budget in budgets])
        mean_stated = math.sqrt(np.mean([budget.random**2 for budget in budgets]))
        # The scatter of 400 runs is known to 3.5 %.
        assert scatter == pytest.approx(mean_stated, rel=0.1)


def test_a_line_is_believed_if_it_is_coherent_and_larger_than_runout():
    clear, noisy = spectrum(motion()), spectrum(motion(noise_um=20.0))

    def excitation(of: CrossSpectrum, **limits: float) -> Reason:
        return line_excitation(of, 0, SHAFT_X, BEARING_X, **limits)

    assert excitation(clear) is Reason.OK
    assert excitation(noisy) is Reason.INSUFFICIENT_EXCITATION
    assert excitation(clear, runout_um_pk=2.4) is Reason.OK
    assert excitation(clear, runout_um_pk=2.6) is Reason.INSUFFICIENT_EXCITATION
    assert excitation(spectrum(motion(n_segments=1))) is Reason.FEW_SEGMENTS


def test_equal_amplitudes_of_any_unit_mean_a_film_as_stiff_as_its_bracket():
    assert effective_stiffness_n_per_m(12.0, 12.0, 1.18e9) == 1.18e9
    assert effective_stiffness_n_per_m(0.02, 0.055, 1.18e9) == pytest.approx(
        effective_stiffness_n_per_m(20.0, 55.0, 1.18e9)
    )
