"""Phasors of a shaft that is shaken and a bracket that answers through a film."""

import numpy as np

from benchmarks.flexible_rotor import FREQUENCY_HZ, hann_noise
from core.arrays import ComplexArray
from core.machine.unit import BracketDynamics
from core.quality import Reason
from core.spectra.cross_spectrum import CrossSpectrum, average
from core.stiffness.dynamic import DynamicStiffness, FilmSpectrum, films
from core.stiffness.dynamic_lines import DynamicSettings

TURN_HZ = (92.3 / 60.0, 92.3 / 60.0)
BRACKET = BracketDynamics(1.18e9, 0.45e5)
STIFFNESS = np.array([[1.2e9, -0.33e9], [-0.25e9, 0.7e9]])
DAMPING = np.array([[1.5e7, 2.0e6], [-1.0e6, 0.9e7]])
NOISE_FREE = DynamicSettings(probe_noise_um2_per_hz=(0.0, 0.0))


def shaken(
    seed: int = 1,
    n_segments: int = 24,
    probe_um: float = 0.0,
    bearing_um: float = 0.0,
    motion_um: float = 1.0,
) -> ComplexArray:
    """Phasors (n_segments, 4, n_lines) of a shaft that is shaken and a bracket that answers."""
    rng = np.random.default_rng(seed)
    omega = 2.0 * np.pi * FREQUENCY_HZ
    film = STIFFNESS[..., np.newaxis] + 1j * omega * DAMPING[..., np.newaxis]
    rolling_off = 1.0 / (1.0 + (FREQUENCY_HZ / 6.0) ** 4)
    shaft = motion_um * rolling_off * hann_noise(rng, n_segments, 2)
    bearing = np.einsum("ijl,sjl->sil", film, shaft)
    bearing /= BRACKET.dynamic_stiffness_n_per_m(FREQUENCY_HZ)
    shaft = shaft + probe_um * hann_noise(rng, n_segments, 2)
    bearing = bearing + bearing_um * hann_noise(rng, n_segments, 2)
    return np.concatenate([shaft, bearing], axis=1)


def averaged(phasors: ComplexArray) -> CrossSpectrum:
    return average(FREQUENCY_HZ, phasors, np.ones(phasors.shape[:2], dtype=bool))


def dynamic_stiffness(
    spectrum: CrossSpectrum,
    bracket: BracketDynamics,
    turn_hz: tuple[float, float],
    settings: DynamicSettings,
    n_integrations: tuple[int, int] = (2, 2),
) -> DynamicStiffness | Reason:
    """Fit the film of one bearing alone."""
    return films([FilmSpectrum(spectrum, bracket, turn_hz, n_integrations)], settings)[0]


def found(
    phasors: ComplexArray,
    settings: DynamicSettings = NOISE_FREE,
    bracket: BracketDynamics = BRACKET,
    n_integrations: tuple[int, int] = (0, 0),  # these phasors are displacement from the start
) -> DynamicStiffness:
    result = dynamic_stiffness(averaged(phasors), bracket, TURN_HZ, settings, n_integrations)
    assert isinstance(result, DynamicStiffness)
    return result
