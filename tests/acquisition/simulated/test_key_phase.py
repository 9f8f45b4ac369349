"""The pulses of a simulated key-phase belong to the same turning as unbalance and runout."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.simulated.key_phase import KeyPhasePulses
from acquisition.simulated.plant import SimulatedPlant
from acquisition.simulated.scenario import KeyPhasePulse, Scenario, TransducerNoise
from core.arrays import FloatArray
from core.key_phase import KeyPhase, read_key_phase
from core.lines import exact_phasors, tapered
from core.machine import Channel, Measurand, Unit

N_CHUNKS = 4


@pytest.fixture
def with_key_phase(machine: Unit) -> Unit:
    """Two pick-ups that see the same mark: one gives pulses that rise, one pulses that fall."""
    pick_ups = (
        Channel("kp", Measurand.KEY_PHASE_V),
        Channel("kp_down", Measurand.KEY_PHASE_V, direction=-1),
    )
    return replace(machine, channels=machine.channels + pick_ups, key_phase="kp")


def readings(machine: Unit, scenario: Scenario) -> FloatArray:
    plant = SimulatedPlant(machine, scenario, seed=7)
    return np.concatenate([plant.advance().readings for _ in range(N_CHUNKS)], axis=1)


@pytest.mark.parametrize("mark_turns", [0.0, 0.37])
@pytest.mark.parametrize("speed_rpm", [60.0, 92.3, 150.0])
def test_runout_has_the_same_phase_to_the_mark_whenever_a_record_begins(
    with_key_phase: Unit, quiet: Scenario, speed_rpm: float, mark_turns: float
) -> None:
    bearings = {
        name: replace(bearing, runout_um_pk=(20.0 * np.exp(0.8j),) if name == "UJB" else ())
        for name, bearing in quiet.bearings.items()
    }
    scenario = replace(
        quiet,
        bearings=bearings,
        unbalance_grade_mm_s=0.0,
        speed_rpm=speed_rpm,
        key_phase=KeyPhasePulse(mark_turns=mark_turns),
    )
    signal = readings(with_key_phase, scenario)
    for start in (0, 100, 333):
        record = signal[:, start:]
        found = read_key_phase(record[-2], 600.0)
        assert isinstance(found, KeyPhase)
        assert found.speed_rpm == pytest.approx(speed_rpm, rel=1e-4)
        turn_hz = np.array([found.speed_rpm / 60.0])
        gap = complex(exact_phasors(tapered(record), 600.0, turn_hz)[0, 0])
        to_mark = -gap * np.exp(-1j * found.shaft_angle_rad)
        assert abs(to_mark) == pytest.approx(20.0, rel=1e-3)
        expected = 0.8 - 2.0 * math.pi * mark_turns
        assert abs(np.angle(to_mark * np.exp(-1j * expected), deg=True)) < 0.5


def test_pulses_that_fall_are_those_that_rise_upside_down(
    with_key_phase: Unit, quiet: Scenario
) -> None:
    up, down = readings(with_key_phase, quiet)[-2:]
    assert up - 0.5 == pytest.approx(0.5 - down)
    assert up.max() == pytest.approx(5.5)
    # six degrees of a turn
    assert np.mean(up - 0.5) == pytest.approx(5.0 * 6.0 / 360.0, rel=0.05)


def test_a_key_phase_has_noise_of_its_own_and_leaves_the_other_channels_as_they_are(
    machine: Unit, with_key_phase: Unit, quiet: Scenario
) -> None:
    noisy = replace(quiet, noise=TransducerNoise(key_phase_v_rms=0.05))
    silent, found = (readings(with_key_phase, scenario) for scenario in (quiet, noisy))
    assert (found - silent)[-2].std() == pytest.approx(0.05, rel=0.05)
    for signal in (silent, found):
        assert np.array_equal(signal[:-2], readings(machine, quiet))


@pytest.mark.parametrize(("mark_turns", "is_under"), [(0.5, False), (1e-3, True)])
def test_a_standing_shaft_gives_one_level(
    with_key_phase: Unit, mark_turns: float, is_under: bool
) -> None:
    pulse = KeyPhasePulse(mark_turns=mark_turns)
    signal = np.zeros((len(with_key_phase.channels), 100))
    KeyPhasePulses(with_key_phase, pulse).add_to(signal, np.zeros(100))

    height_v = pulse.height_v if is_under else 0.0
    assert signal[-2] == pytest.approx(pulse.rest_v + height_v)
    assert signal[-1] == pytest.approx(pulse.rest_v - height_v)
