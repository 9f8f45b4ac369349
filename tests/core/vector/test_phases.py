"""With phases beside the amplitudes of a rack, stiffness and damping are told apart."""

from dataclasses import replace

import numpy as np
import pytest
from rigs.racks import AMPLITUDES, K_B, PHASES, blocks_of, watch

from core.assessment import Evidence
from core.blocks import SampleBlock
from core.quality import GOOD, Reason, bad, missing

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


def test_vectors_that_do_not_hang_together_give_no_stiffness(rack) -> None:
    newest = watch(rack(AMPLITUDES + PHASES), vectors(noise_deg=60.0))[-1]

    for name in ("order1_k_eff_xx_n_per_m", "order1_transfer_k_xx_n_per_m"):
        assert newest.readings[name] == missing(Reason.INSUFFICIENT_EXCITATION)


def test_exchanged_phases_are_doubted_as_exchanged_axes(rack) -> None:
    monitor = rack(AMPLITUDES + PHASES, rotation_sense=-1)
    newest = watch(monitor, vectors())[-1]

    assert newest.readings["stiffness_xx_n_per_m"].quality.reason is Reason.SWAPPED_AXES


def test_a_phase_that_is_bad_is_no_phase(rack) -> None:
    blocks = [
        replace(b, channel_quality=(GOOD,) * 6 + (bad(Reason.SENSOR_FAILURE),) * 2)
        for b in vectors()
    ]
    newest = watch(rack(AMPLITUDES + PHASES), blocks)[-1]

    assert newest.readings["order1_transfer_k_xx_n_per_m"] == missing(Reason.NOT_MEASURED)
    assert newest.readings["order1_k_eff_xx_n_per_m"].value is not None
    assert newest.evidence is Evidence.AMPLITUDE_ONLY
