"""Overall values of shafts and bearings, and runout that is taken off by the angle of the shaft."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block

from core.arrays import FloatArray
from core.machine.channel import Channel, Measurand, SlowRollVector
from core.machine.response import HighPass
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Reading, Reason, bad, uncertain
from core.spectra.runout import RunoutVerdict, without_runout
from core.spectra.speed import KeyPhase, Speed, SpeedSource

RATE_HZ, N = 600.0, 2 * 8192
TIME_S = np.arange(N) / RATE_HZ
TURN_HZ = 92.3 / 60.0

Measure = Callable[..., Mapping[str, Reading]]


def tone(amplitude: float, frequency_hz: float, lead_deg: float = 0.0) -> FloatArray:
    return amplitude * np.cos(2 * np.pi * frequency_hz * TIME_S + math.radians(lead_deg))


def pulses(mark_s: float) -> FloatArray:
    """One pulse a turn that begins when the mark passes, a tenth of a turn long."""
    turns = (TIME_S - mark_s) * TURN_HZ
    return np.where(turns % 1.0 < 0.1, 5.0, 0.0)


@pytest.fixture
def measure(unit: Unit) -> Measure:
    def read(*signals: FloatArray, there: Unit = unit, **other: Any) -> Mapping[str, Reading]:
        settings = AnalysisSettings(**other)
        rows = np.array([s + np.zeros(N) for s in signals], dtype=np.float32)
        slow = {"power": Reading(650.0), "oil": Reading(45.0), "speed": Reading(92.3)}
        block = given_block("U1", 1, 0, 0, RATE_HZ, rows, (GOOD,) * len(signals), slow)
        return list(UnitMonitor(there, settings).steps(block))[-1].readings

    return read


STILL = np.full(N, 2000.0)


@pytest.fixture
def velocity(unit: Unit, measure: Measure) -> Callable[..., float | None]:
    """Measures the bearing's velocity with a transducer."""

    def read(
        signal: FloatArray, measurand: Measurand, response: HighPass | None = None, **other: Any
    ) -> float | None:
        bearings = (Channel(id_, measurand, response=response) for id_ in ("bx", "by"))
        there = replace(unit, channels=(*unit.channels[:2], *bearings))
        found = measure(STILL, STILL, signal, signal, there=there, **other)
        return found["overall_bearing_x_mm_s_rms"].value

    return read


def test_a_shaft_is_measured_from_peak_to_peak_and_by_its_farthest_excursion(measure):
    both = tone(60.0, TURN_HZ) + tone(15.0, 3 * TURN_HZ)
    found = measure(2000.0 + both, 2000.0 + tone(40.0, 7.3), 0 * TIME_S, 0 * TIME_S)

    assert found["overall_shaft_x_um_pp"].value == pytest.approx(150.0, rel=2e-3)
    assert found["overall_shaft_y_um_pp"].value == pytest.approx(80.0, rel=2e-3)

    slanted = tone(60.0, TURN_HZ)
    found = measure(2000.0 + slanted, 1900.0 + slanted, 0 * TIME_S, 0 * TIME_S)

    assert found["overall_shaft_um_pk"].value == pytest.approx(60.0 * math.sqrt(2.0), rel=5e-3)


@pytest.mark.parametrize(
    ("measurand", "per_velocity"),
    [
        (Measurand.VELOCITY_MM_S, 1.0),
        (Measurand.ACCELERATION_M_S2, 2 * math.pi * 20.0 * 1e-3),
        (Measurand.DISPLACEMENT_UM, 1e3 / (2 * math.pi * 20.0)),
    ],
)
def test_a_bearing_has_the_same_velocity_whatever_measures_it(velocity, measurand, per_velocity):
    found = velocity(tone(3.0 * per_velocity, 20.0), measurand)
    assert found == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-3)


def test_velocity_has_the_power_of_its_band_after_what_the_transducer_takes_away(velocity):
    noise = np.random.default_rng(4).normal(size=N)  # mm/s, white up to 300 Hz
    assert velocity(noise, Measurand.VELOCITY_MM_S) == pytest.approx(1.0, rel=0.03)
    corner = HighPass(0.5)
    passed = abs(complex(corner.at(np.array([TURN_HZ]))[0]))
    found = velocity(tone(3.0 * passed, TURN_HZ), Measurand.VELOCITY_MM_S, corner)
    assert found == pytest.approx(3.0 / math.sqrt(2.0), rel=5e-3)
    signal = tone(3.0, 20.0) + tone(9.0, 200.0)
    found = velocity(signal, Measurand.VELOCITY_MM_S, velocity_high_hz=100.0)
    assert found == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-3)


def test_without_a_displacement_or_a_key_phase_there_is_no_shaft_motion_or_no_phase(measure, unit):
    shafts = tuple(Channel(id_, Measurand.VELOCITY_MM_S) for id_ in ("sx", "sy"))
    there = replace(unit, channels=(*shafts, *unit.channels[2:]))
    found = measure(*[tone(60.0, TURN_HZ)] * 4, there=there)

    for name in ("overall_shaft_x_um_pp", "overall_shaft_um_pk"):
        assert found[name].quality == bad(Reason.NOT_MEASURED)

    turning = tone(60.0, TURN_HZ)
    found = measure(2e3 + turning, 2e3 + turning, turning, turning)

    assert found["order1_shaft_x_phase_deg"].quality == bad(Reason.NOT_MEASURED)


@pytest.mark.parametrize("mark_s", [0.0, 0.2, 0.5])
def test_a_phase_is_the_same_whenever_a_record_begins(measure, unit, mark_s):
    kp = Channel("kp", Measurand.KEY_PHASE_V)
    there = replace(unit, channels=(*unit.channels, kp), key_phase="kp")
    since = 360.0 * TURN_HZ * mark_s  # the shaft's angle at the first sample is less by this
    x, y = tone(60.0, TURN_HZ, 30.0 - since), tone(60.0, TURN_HZ, -60.0 - since)
    found = measure(2e3 - x, 2e3 - y, x / 3, y / 3, pulses(mark_s), there=there)

    assert found["order1_shaft_x_phase_deg"].value == pytest.approx(30.0, abs=0.5)
    assert found["order1_shaft_y_phase_deg"].value == pytest.approx(300.0, abs=0.5)
    assert found["order1_bearing_x_phase_deg"].value == pytest.approx(30.0, abs=0.5)


VECTOR = SlowRollVector("SN 4711", 10.0 * cmath.exp(0.4j), 12.0)
VIBRATION = 25.0 * cmath.exp(-1.1j)
"""Relative to the mark on the shaft, as the vector is."""

UNDOUBTED = Speed(Reading(92.3), SpeedSource.KEY_PHASE)


def of_one_channel(
    unit: Unit, read: complex, vector: SlowRollVector | None, probe: str, angle_rad: float | None
) -> tuple[complex, RunoutVerdict]:
    """The phasor of the x probe without runout, and the verdict on its vector."""
    channel = replace(unit.channels[0], probe=probe, slow_roll=vector)
    there = replace(unit, rated_speed_rpm=92.3, channels=(channel, *unit.channels[1:]))
    key_phase = None if angle_rad is None else KeyPhase(angle_rad, 92.3, 1e-5, 20)
    found, verdicts = without_runout(np.array([read]), there, [0], UNDOUBTED, key_phase)
    return complex(found[0]), verdicts[channel.id]


@pytest.mark.parametrize("shaft_angle_rad", [0.0, 0.9, -2.0, 40.0])
def test_what_is_left_is_the_vibration_wherever_the_segment_began(unit, shaft_angle_rad):
    start = cmath.exp(1j * shaft_angle_rad)
    read = (VIBRATION + VECTOR.phasor_um_pk) * start

    phasor_um_pk, verdict = of_one_channel(unit, read, VECTOR, "SN 4711", shaft_angle_rad)

    assert phasor_um_pk == pytest.approx(VIBRATION * start)
    assert verdict is RunoutVerdict.APPLIED


@pytest.mark.parametrize(
    ("vector", "probe", "angle_rad", "verdict"),
    [
        (None, "SN 4711", 0.9, RunoutVerdict.NO_VECTOR),
        (VECTOR, "SN 4712", 0.9, RunoutVerdict.OTHER_PROBE),
        (replace(VECTOR, speed_rpm=60.0), "SN 4711", 0.9, RunoutVerdict.NOT_SLOW_ROLL),
        (replace(VECTOR, speed_rpm=0.0), "SN 4711", 0.9, RunoutVerdict.NOT_SLOW_ROLL),
        (VECTOR, "SN 4711", None, RunoutVerdict.NO_PHASE_REFERENCE),
    ],
)
def test_a_useless_vector_is_left_out_and_named(unit, vector, probe, angle_rad, verdict):
    found = of_one_channel(unit, VIBRATION, vector, probe, angle_rad)

    assert found == (VIBRATION, verdict)


PHASORS = np.array([30.0 + 10.0j, 20.0j, 5.0 + 0.0j, 5.0j])
SURFACE = 8.0 * np.exp(0.5j)
KEY_PHASE = KeyPhase(1.2, 92.3, 1e-5, 20)


@pytest.fixture
def rough(unit: Unit) -> Unit:
    """The unit with a vector for its x probe alone."""
    vector = SlowRollVector("SN1", complex(SURFACE), 8.0)
    first = replace(unit.channels[0], probe="SN1", slow_roll=vector)
    return replace(unit, channels=(first, *unit.channels[1:]))


def test_only_the_channel_with_a_vector_changes(rough):
    found, verdicts = without_runout(PHASORS, rough, [0, 1], UNDOUBTED, KEY_PHASE)
    assert found[0] == pytest.approx(PHASORS[0] - SURFACE * np.exp(1.2j))
    assert np.array_equal(found[1:], PHASORS[1:])
    assert verdicts == {"sx": RunoutVerdict.APPLIED, "sy": RunoutVerdict.NO_VECTOR}
    assert PHASORS[0] == 30.0 + 10.0j


@pytest.mark.parametrize(
    "speed",
    [
        Speed(Reading(92.3), SpeedSource.SLOW_CHANNEL),
        Speed(Reading(92.3, uncertain(Reason.SPEED_IMPLAUSIBLE)), SpeedSource.KEY_PHASE),
    ],
    ids=["another speed", "a doubted speed"],
)
def test_an_angle_without_its_own_speed_is_none(rough, speed):
    found, verdicts = without_runout(PHASORS, rough, [0, 1], speed, KEY_PHASE)
    assert np.array_equal(found, PHASORS)
    assert verdicts["sx"] is RunoutVerdict.NO_PHASE_REFERENCE
