"""Runout from slow roll: taken off by the shaft's own angle, or not at all."""

import cmath
from dataclasses import replace

import pytest

from core.runout import RunoutVerdict, SlowRollVector, take_off_runout

VECTOR = SlowRollVector("ujb_shaft_x", "SN 4711", 10.0 * cmath.exp(0.4j), 12.0, 1_790_000_000)
VIBRATION = 25.0 * cmath.exp(-1.1j)
"""Relative to the mark on the shaft, as the vector is."""


@pytest.mark.parametrize("shaft_angle_rad", [0.0, 0.9, -2.0, 40.0])
def test_what_is_left_is_the_vibration_wherever_the_segment_began(shaft_angle_rad: float) -> None:
    start = cmath.exp(1j * shaft_angle_rad)
    read = (VIBRATION + VECTOR.phasor_um_pk) * start

    line = take_off_runout(read, VECTOR, "SN 4711", 92.3, shaft_angle_rad)

    assert line.phasor_um_pk == pytest.approx(VIBRATION * start)
    assert line.verdict is RunoutVerdict.APPLIED


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
    line = take_off_runout(VIBRATION, vector, probe, 92.3, angle_rad)

    assert line.phasor_um_pk == VIBRATION
    assert line.verdict is verdict
