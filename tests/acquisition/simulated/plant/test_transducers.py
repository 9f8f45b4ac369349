import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.simulated.plant.chain import KeyPhasePulses
from acquisition.simulated.plant.faults import to_counts
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.plant import SimulatedPlant
from acquisition.simulated.plant.scenario import KeyPhasePulse, Scenario
from core.arrays import FloatArray
from core.checks.channels import COUNTS_FULL_SCALE
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.spectra.lines import part_phasors, turning_factors
from core.spectra.speed import KeyPhase, read_key_phase


def readings(machine: Unit, scenario: Scenario, n_chunks: int = 1) -> FloatArray:
    plant = SimulatedPlant(machine, scenario, seed=7)
    return np.concatenate([plant.advance().readings for _ in range(n_chunks)], axis=1)


def test_velocity_and_acceleration_are_derivatives_of_displacement(machine_with, quiet):
    displacement_um, velocity_mm_s, acceleration_m_s2 = (
        readings(machine_with(measurand), quiet)[2]
        for measurand in (
            Measurand.DISPLACEMENT_UM,
            Measurand.VELOCITY_MM_S,
            Measurand.ACCELERATION_M_S2,
        )
    )
    inner = slice(1, -1)

    # Central differences at 1.54 Hz and 600 Hz are off by (ω dt)² / 6 = 4e-5.
    assert np.gradient(displacement_um, 1 / 600.0)[inner] / 1e3 == pytest.approx(
        velocity_mm_s[inner], abs=2e-4 * np.abs(velocity_mm_s).max()
    )
    assert np.gradient(velocity_mm_s, 1 / 600.0)[inner] / 1e3 == pytest.approx(
        acceleration_m_s2[inner], abs=2e-4 * np.abs(acceleration_m_s2).max()
    )


def test_a_displacement_probe_without_gap_reads_the_vibration_alone(machine, quiet):
    probe = Channel("UJB_ux", Measurand.DISPLACEMENT_UM)
    bare = replace(machine, channels=(probe, *machine.channels[1:]))

    vibration_um = readings(bare, quiet)[0]

    assert vibration_um == pytest.approx(1940.0 - readings(machine, quiet)[0])
    assert np.abs(vibration_um).max() == pytest.approx(9.3, rel=0.01)


def test_the_machine_has_long_been_running_when_the_first_sample_is_taken(machine, quiet):
    soft = {
        name: replace(b, film=Film.proportional(0.4e9, 0.4e9)) for name, b in quiet.bearings.items()
    }
    signal = readings(machine, replace(quiet, speed_rpm=90.0, bearings=soft), 2)

    # One turn takes exactly 400 samples.
    assert signal[:, 400:800] == pytest.approx(signal[:, :400], abs=1e-3)


def test_a_wandering_shaft_leaves_no_step_in_the_gap(machine, quiet):
    wandering = {name: replace(b, centre_wander_um_rms=30.0) for name, b in quiet.bearings.items()}
    still = replace(quiet, unbalance_grade_mm_s=0.0, wander_time_s=20.0)

    gap_um = readings(machine, replace(still, bearings=wandering), 20)[0]

    assert np.ptp(gap_um) > 30.0
    assert np.abs(np.diff(gap_um)).max() < 0.1


def test_the_converter_rounds_to_counts_and_clips_at_its_rails(calibration):
    per_count = np.array([c.unit_per_count for c in calibration.channels])
    signal = np.array([0.0, 0.4, 0.6, -1.4, 32767.4, 4.0e4, -4.0e4])

    counts = to_counts(per_count[:, np.newaxis] * signal, calibration)

    rails = [COUNTS_FULL_SCALE - 1, COUNTS_FULL_SCALE - 1, -COUNTS_FULL_SCALE]
    assert counts.dtype == np.int16
    assert counts.tolist() == [[0, 0, 1, -1, *rails]] * 12


@pytest.mark.parametrize(
    ("place", "channel", "measurand", "words"),
    [
        (12, "stator_core", "velocity_mm_s", "'stator_core' belongs to no bearing"),
        (0, "UJB_ux", "velocity_mm_s", "cannot measure velocity_mm_s"),
        (2, "UJB_vx", "gap_um", "cannot measure gap_um"),
    ],
)
def test_a_channel_that_no_bearing_has_is_refused(machine, quiet, place, channel, measurand, words):
    channels = list(machine.channels)
    channels[place : place + 1] = [Channel(channel, Measurand(measurand))]
    with pytest.raises(ConfigError, match=words):
        SimulatedPlant(replace(machine, channels=tuple(channels)), quiet, seed=1)


def test_a_bearing_the_rotor_does_not_have_is_refused(machine, quiet):
    strange: Bearing = replace(machine.bearings[0], id="GEN-DE")
    with pytest.raises(ConfigError, match="unknown bearing 'GEN-DE'; the simulated rotor has UJB"):
        SimulatedPlant(
            replace(machine, bearings=(strange, *machine.bearings[1:])),
            replace(quiet, bearings={**quiet.bearings, "GEN-DE": quiet.bearings["UJB"]}),
            seed=1,
        )


N_CHUNKS = 4


@pytest.fixture
def with_key_phase(machine: Unit) -> Unit:
    """Two pick-ups that see the same mark: one gives pulses that rise, one pulses that fall."""
    pick_ups = (
        Channel("kp", Measurand.KEY_PHASE_V),
        Channel("kp_down", Measurand.KEY_PHASE_V, direction=-1),
    )
    return replace(machine, channels=machine.channels + pick_ups, key_phase="kp")


@pytest.mark.parametrize("mark_turns", [0.0, 0.37])
@pytest.mark.parametrize("speed_rpm", [60.0, 92.3, 150.0])
def test_runout_has_the_same_phase_to_the_mark_whenever_a_record_begins(
    with_key_phase, quiet, speed_rpm, mark_turns
):
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
    signal = readings(with_key_phase, scenario, N_CHUNKS)
    for start in (0, 100, 333):
        record = signal[:, start:]
        found = read_key_phase(record[-2], 600.0)
        assert isinstance(found, KeyPhase)
        assert found.speed_rpm == pytest.approx(speed_rpm, rel=1e-4)
        turn_hz = np.array([found.speed_rpm / 60.0])
        turning = turning_factors(record.shape[1], 600.0, turn_hz)
        gap = complex(part_phasors(record, turning)[0, 0])
        to_mark = -gap * np.exp(-1j * found.shaft_angle_rad)
        assert abs(to_mark) == pytest.approx(20.0, rel=1e-3)
        expected = 0.8 - 2.0 * math.pi * mark_turns
        assert abs(np.angle(to_mark * np.exp(-1j * expected), deg=True)) < 0.5


def test_pulses_that_fall_are_those_that_rise_upside_down(with_key_phase, quiet):
    up, down = readings(with_key_phase, quiet, N_CHUNKS)[-2:]
    assert up - 0.5 == pytest.approx(0.5 - down)
    assert up.max() == pytest.approx(5.5)
    # six degrees of a turn
    assert np.mean(up - 0.5) == pytest.approx(5.0 * 6.0 / 360.0, rel=0.05)


@pytest.mark.parametrize(("mark_turns", "is_under"), [(0.5, False), (1e-3, True)])
def test_a_standing_shaft_gives_one_level(with_key_phase, mark_turns, is_under):
    pulse = KeyPhasePulse(mark_turns=mark_turns)
    signal = np.zeros((len(with_key_phase.channels), 100))
    KeyPhasePulses(with_key_phase, pulse).add_to(signal, np.zeros(100))

    height_v = pulse.height_v if is_under else 0.0
    assert signal[-2] == pytest.approx(pulse.rest_v + height_v)
    assert signal[-1] == pytest.approx(pulse.rest_v - height_v)
