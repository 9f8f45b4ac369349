"""Runout from slow roll: taken off by the shaft's own angle, or not at all."""

import cmath
from dataclasses import replace

import numpy as np
import pytest

from core.machine.channel import SlowRollVector
from core.machine.unit import Unit
from core.quality import Reading, Reason, uncertain
from core.spectra.runout import RunoutVerdict, take_off_runout, without_runout
from core.spectra.speed import KeyPhase, Speed, SpeedSource

VECTOR = SlowRollVector("ujb_shaft_x", "SN 4711", 10.0 * cmath.exp(0.4j), 12.0, 1_790_000_000)
VIBRATION = 25.0 * cmath.exp(-1.1j)
"""Relative to the mark on the shaft, as the vector is."""


@pytest.mark.parametrize("shaft_angle_rad", [0.0, 0.9, -2.0, 40.0])
def test_what_is_left_is_the_vibration_wherever_the_segment_began(shaft_angle_rad: float) -> None:
    start = cmath.exp(1j * shaft_angle_rad)
    read = (VIBRATION + VECTOR.phasor_um_pk) * start

    phasor_um_pk, verdict = take_off_runout(read, VECTOR, "SN 4711", 92.3, shaft_angle_rad)

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
def test_a_vector_that_is_of_no_use_is_left_out_and_said_to_be(
    vector: SlowRollVector | None,
    probe: str,
    angle_rad: float | None,
    verdict: RunoutVerdict,
) -> None:
    found = take_off_runout(VIBRATION, vector, probe, 92.3, angle_rad)

    assert found == (VIBRATION, verdict)


PHASORS = np.array([30.0 + 10.0j, 20.0j, 5.0 + 0.0j, 5.0j])
SURFACE = 8.0 * np.exp(0.5j)
KEY_PHASE = KeyPhase(shaft_angle_rad=1.2, speed_rpm=92.3)
UNDOUBTED = Speed(Reading(92.3), SpeedSource.KEY_PHASE)


@pytest.fixture
def rough(unit: Unit) -> Unit:
    """The unit with a vector for its x probe alone."""
    vector = SlowRollVector("sx", "SN1", complex(SURFACE), 8.0, 0)
    first = replace(unit.channels[0], probe="SN1", slow_roll=vector)
    return replace(unit, channels=(first, *unit.channels[1:]))


def test_only_the_channel_with_a_vector_changes(rough: Unit) -> None:
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
def test_an_angle_without_its_own_speed_is_none(rough: Unit, speed: Speed) -> None:
    found, verdicts = without_runout(PHASORS, rough, [0, 1], speed, KEY_PHASE)
    assert np.array_equal(found, PHASORS)
    assert verdicts["sx"] is RunoutVerdict.NO_PHASE_REFERENCE
