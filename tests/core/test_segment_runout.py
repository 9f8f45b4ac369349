"""Runout comes off where angle and speed are of the same undoubted pulses, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from core.key_phase import KeyPhase
from core.machine import Unit
from core.quality import Reading, Reason, uncertain
from core.runout import RunoutVerdict, SlowRollVector
from core.segment_runout import without_runout
from core.speed import Speed, SpeedSource

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
