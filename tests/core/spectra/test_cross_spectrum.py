"""Averages over segments: Hermitian, and honest about which segments count."""

import numpy as np
import pytest

from core.spectra.cross_spectrum import average

FREQUENCY_HZ = np.array([1.0, 2.0])


@pytest.fixture
def phasors() -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.normal(size=(9, 4, 2)) + 1j * rng.normal(size=(9, 4, 2))


def test_the_matrix_is_hermitian_and_its_diagonal_is_the_power(phasors: np.ndarray) -> None:
    spectrum = average(FREQUENCY_HZ, phasors, np.ones((9, 4), dtype=bool))
    np.testing.assert_allclose(spectrum.matrix, spectrum.matrix.conj().transpose(0, 2, 1))
    np.testing.assert_allclose(
        np.diagonal(spectrum.matrix, axis1=1, axis2=2),
        np.diagonal(spectrum.power, axis1=1, axis2=2),
    )
    np.testing.assert_allclose(
        spectrum.matrix[1, 0, 2], np.mean(phasors[:, 0, 1] * phasors[:, 2, 1].conj())
    )


def test_a_failed_channel_takes_nothing_from_the_others(phasors: np.ndarray) -> None:
    usable = np.ones((9, 4), dtype=bool)
    usable[3:, 2] = False
    spoiled = phasors.copy()
    spoiled[3:, 2] = 1e9
    spectrum = average(FREQUENCY_HZ, spoiled, usable)
    whole = average(FREQUENCY_HZ, phasors, np.ones((9, 4), dtype=bool))
    np.testing.assert_allclose(spectrum.power[:, 0, 1], whole.power[:, 0, 1])
    own = np.mean(np.abs(phasors[:3, 2]) ** 2, axis=0)
    np.testing.assert_allclose(spectrum.amplitude_um_pk(2), np.sqrt(own))
    assert spectrum.n_segments[0, 1] == 9
    assert spectrum.n_segments[0, 2] == 3


def test_amplitudes_that_are_compared_come_from_the_same_segments() -> None:
    """A machine whose motion grows tenfold after the accelerometer fails keeps its ratio."""
    phasors = np.ones((4, 2, 1), dtype=complex)
    phasors[:, 0] = 2.0
    phasors[2:, 0] = 20.0
    usable = np.array([[True, True], [True, True], [True, False], [True, False]])
    spectrum = average(np.array([1.0]), phasors, usable)
    assert spectrum.amplitude_ratio(1, 0)[0] == pytest.approx(0.5)
    assert spectrum.amplitude_um_pk(0)[0] == pytest.approx(np.sqrt((4 + 4 + 400 + 400) / 4))


def test_coherence_is_one_for_a_common_cause_small_for_none_and_zero_for_nothing(
    phasors: np.ndarray,
) -> None:
    usable = np.ones((9, 4), dtype=bool)
    common = phasors.copy()
    common[:, 1] = (0.3 + 0.4j) * common[:, 0]
    spectrum = average(FREQUENCY_HZ, common, usable)
    np.testing.assert_allclose(spectrum.coherence(0, 1), 1.0)
    assert np.all(spectrum.coherence(0, 2) < 0.6)
    spectrum = average(FREQUENCY_HZ, phasors, np.zeros((9, 4), dtype=bool))
    assert not spectrum.n_segments.any()
    assert not spectrum.coherence(0, 2).any()
    assert not spectrum.amplitude_ratio(2, 0).any()
