"""Orbits turn forward or backward, and the vortex is where both ends of the film move."""

import numpy as np
import pytest

from core.arrays import ComplexArray
from core.spectra.cross_spectrum import CrossSpectrum, average
from core.spectra.vortex import roundness, vortex_frequency_hz

FREQUENCY_HZ = 0.0732421875 * np.arange(1, 41)


def spectrum(phasors: ComplexArray) -> CrossSpectrum:
    return average(FREQUENCY_HZ, phasors, np.ones(phasors.shape[:2], dtype=bool))


def noise(seed: int, n_segments: int = 24) -> ComplexArray:
    rng = np.random.default_rng(seed)
    shape = (n_segments, 4, FREQUENCY_HZ.size)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def orbit(x: complex, y: complex, n_segments: int = 24) -> CrossSpectrum:
    phasors = np.zeros((n_segments, 4, FREQUENCY_HZ.size), dtype=np.complex128)
    phasors[:, 0], phasors[:, 1] = x, y
    return spectrum(phasors)


def test_x_before_y_is_forward_and_a_straight_line_has_no_sense() -> None:
    assert roundness(orbit(2.0, -2.0j), 3) == pytest.approx(1.0)
    assert roundness(orbit(2.0, 2.0j), 3) == pytest.approx(-1.0)
    assert roundness(orbit(-1.0j, 1.0), 3) == pytest.approx(-1.0)  # exchanged
    assert roundness(orbit(1.0, 2.0), 3) == 0.0
    assert roundness(orbit(0.0, 0.0), 3) == 0.0
    chance = [roundness(spectrum(noise(seed)), 3) for seed in range(200)]
    assert np.std(chance) == pytest.approx(np.sqrt(1.0 / 48.0), rel=0.2)


def with_line(phasors: ComplexArray, line: int, size: float, rows: slice) -> ComplexArray:
    """Add a Hann-shaped line around a bin, common to some channels and random in phase."""
    phase = np.exp(2j * np.pi * np.random.default_rng(9).uniform(size=(phasors.shape[0], 1)))
    changed = phasors.copy()
    for offset, share in ((-1, -0.5), (0, 1.0), (1, -0.5)):
        changed[:, rows, line + offset] += share * size * phase
    return changed


def test_a_vortex_is_a_shared_line_and_neither_a_flank_nor_nothing() -> None:
    shared = with_line(noise(1), 5, 10.0, slice(None))
    louder_in_one_probe = with_line(shared, 8, 30.0, slice(0, 1))
    silent, moving = noise(1), with_line(noise(2), 6, 10.0, slice(None))

    for line, bearings in ((5, [louder_in_one_probe]), (6, [silent, moving])):
        found = vortex_frequency_hz([spectrum(phasors) for phasors in bearings], (0.3, 0.7))
        assert found == pytest.approx(FREQUENCY_HZ[line], abs=0.3 * FREQUENCY_HZ[0])

    beyond = with_line(1e-3 * noise(1), 12, 10.0, slice(None))
    assert vortex_frequency_hz([spectrum(beyond)], (0.6, 0.89)) is None
    assert vortex_frequency_hz([orbit(0.0, 0.0)], (5.0, 6.0)) is None
