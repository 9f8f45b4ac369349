"""What is read off single channels is as uncertain as is said."""

import numpy as np
import pytest
from rigs.shaken_shaft import found, shaken
from rigs.tiers import covering

from core.machine.unit import Bearing, BearingAccuracy
from core.spectra.cross_spectrum import average, roundness
from core.stiffness.channel_budget import (
    amplitude_budget,
    coherence_budget,
    phase_budget,
    roundness_budget,
)
from core.uncertainty import mean_budget

N_SEGMENTS, N_LIVES = 24, 3000


def wandering(correlation: float, seed: int = 5) -> np.ndarray:
    """Complex noise (n_lives, n_segments) of unit power in each part, neighbours correlated."""
    random = np.random.default_rng(seed)
    steps = random.normal(size=(2, N_SEGMENTS, N_LIVES))
    noise = np.empty_like(steps)
    noise[:, 0] = steps[:, 0]
    for n in range(1, N_SEGMENTS):
        kept = correlation * noise[:, n - 1]
        noise[:, n] = kept + np.sqrt(1.0 - correlation**2) * steps[:, n]
    return (noise[0] + 1j * noise[1]).T


def share_within(intervals: list[tuple[float, float]], truth: float) -> float:
    return float(np.mean([low <= truth <= high for low, high in intervals]))


@pytest.mark.parametrize(("correlation", "least"), [(0.0, 0.93), (0.4, 0.90)])
def test_intervals_of_amplitude_phase_and_mean_hold_the_truth(correlation, least):
    phasors = 20.0 * np.exp(1j * np.radians(30.0)) + wandering(correlation)
    rms = np.sqrt(np.mean(np.abs(phasors) ** 2, axis=1))
    turned = np.degrees(np.angle(phasors.mean(axis=1)))
    found = {
        "amplitude": [amplitude_budget(a, v, ()) for a, v in zip(rms, phasors, strict=True)],
        "phase": [phase_budget(p, v) for p, v in zip(turned, phasors, strict=True)],
        "mean": [mean_budget(v.real.mean(), v.real) for v in phasors],
    }
    truth = {"amplitude": np.sqrt(402.0), "phase": 30.0, "mean": 20.0 * np.sqrt(0.75)}
    for name, budgets in found.items():
        share = share_within([budget.interval for budget in budgets], truth[name])
        assert least < share < 0.97, (name, share)


def test_what_never_differs_says_nothing_of_how_well_it_is_known():
    assert mean_budget(45.0, [45.0] * 24) is None
    assert mean_budget(45.0, [45.0]) is None
    assert mean_budget(45.5, [45.0, 46.0]).random == pytest.approx(0.5)


@pytest.mark.parametrize(("coherence", "n_segments"), covering([0.1, 0.6, 0.9, 0.999], [24, 8, 4]))
def test_intervals_of_a_coherence_hold_the_truth_and_stay_between_0_and_1(n_segments, coherence):
    shaft, noise = (wandering(0.0, seed)[:, :n_segments] for seed in (1, 2))
    bearing = np.sqrt(coherence) * shaft + np.sqrt(1.0 - coherence) * noise
    power = (np.abs(shaft) ** 2).mean(axis=1) * (np.abs(bearing) ** 2).mean(axis=1)
    measured = np.abs((shaft * bearing.conj()).mean(axis=1)) ** 2 / power
    budgets = [coherence_budget(float(value), n_segments) for value in measured]

    assert 0.93 < share_within([b.interval for b in budgets], coherence) < 0.98
    assert all(0.0 <= b.interval[0] < b.interval[1] <= 1.0 for b in budgets)
    if n_segments == N_SEGMENTS:
        assert np.std(measured) == pytest.approx(np.mean([b.random for b in budgets]), rel=0.1)


def test_a_coherence_of_one_segment_or_of_all_or_nothing_has_no_interval():
    assert [coherence_budget(*of) for of in ((0.9, 1.0), (1.0, 24.0), (0.0, 24.0))] == [None] * 3


@pytest.mark.parametrize(
    ("across", "correlation", "least"), [(20, 0, 0.9), (8, 0, 0.93), (8, 0.4, 0.9)]
)
def test_intervals_of_a_roundness_hold_the_truth(across, correlation, least):
    exact = BearingAccuracy(shaft_gain=0.0)
    bearing = Bearing("UJB", 1e9, "sx", "sy", "bx", "by", 200.0, (0.0, 0.0), accuracy=exact)
    x, y = 20.0 + wandering(correlation, 1), -1j * across + wandering(correlation, 2)
    intervals = []
    for life in np.stack([x, y], axis=2):
        four = np.concatenate([life, np.zeros_like(life)], axis=1)[:, :, np.newaxis]
        spectrum = average(np.ones(1), four, np.ones((N_SEGMENTS, 4), dtype=bool))
        value = roundness(spectrum, 0)
        intervals.append(roundness_budget(bearing, value, life, (0.0, 0.0)).interval)

    truth = 2.0 * 20.0 * across / (20.0**2 + across**2 + 4.0)
    assert least < share_within(intervals, truth) < 0.98
    assert all(-1.0 <= low < high <= 1.0 for low, high in intervals)


def test_gain_and_runout_make_an_orbit_seem_rounder_or_flatter():
    """As much as the formula says, to first order, by moving them."""
    bearing = Bearing("UJB", 1e9, "sx", "sy", "bx", "by", 200.0, (0.0, 0.0))

    def of(x: complex, y: complex) -> float:
        return 2.0 * (x * np.conj(y)).imag / (abs(x) ** 2 + abs(y) ** 2)

    x, y, small = 20.0 + 0j, -8.0j, 1e-4
    orbit = np.array([[x, y], [1.01 * x, y]])
    lines = roundness_budget(bearing, of(x, y), orbit, (1.0, 1.0)).lines[1:]
    turns = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 360))
    moved = (
        (of((1.0 + small) * x, y) - of(x, y)) / small,
        (of(x, (1.0 + small) * y) - of(x, y)) / small,
        max(of(x + small * turn, y) - of(x, y) for turn in turns) / small,
        max(of(x, y + small * turn) - of(x, y) for turn in turns) / small,
    )
    for line, change in zip(lines, moved, strict=True):
        assert line.sensitivity == pytest.approx(change, rel=0.02), line.name


@pytest.mark.parametrize("bearing_um", [0.03, 0.3])
def test_intervals_of_the_multiple_coherence_of_dynamic_hold_the_truth(bearing_um):
    truth = found(shaken(999, 600, bearing_um=bearing_um)).coherence
    results = [found(shaken(seed, 12, bearing_um=bearing_um)) for seed in range(80)]
    for row in (0, 1):
        pairs = [(r.coherence[row], r.coherence_segments[row]) for r in results]
        budgets = [coherence_budget(float(value), float(n)) for value, n in pairs]
        spread = np.std([value for value, _ in pairs]) / np.mean([b.random for b in budgets])
        assert share_within([b.interval for b in budgets], truth[row]) > 0.9
        assert 0.7 < spread < 1.2
