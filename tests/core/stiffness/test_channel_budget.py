"""What is read off single channels is as uncertain as is said."""

import numpy as np
import pytest

from core.stiffness.channel_budget import amplitude_budget, phase_budget
from core.uncertainty import mean_budget

N_SEGMENTS, N_LIVES = 24, 3000


def wandering(correlation: float) -> np.ndarray:
    """Complex noise (n_lives, n_segments) of unit power in each part, neighbours correlated."""
    random = np.random.default_rng(5)
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
def test_intervals_of_amplitude_phase_and_mean_hold_the_truth(correlation, least) -> None:
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


def test_what_never_differs_says_nothing_of_how_well_it_is_known() -> None:
    assert mean_budget(45.0, [45.0] * 24) is None
    assert mean_budget(45.0, [45.0]) is None
    assert mean_budget(45.5, [45.0, 46.0]).random == pytest.approx(0.5)
