"""Which speed is believed when a key-phase, a speed channel and the 1× line are at hand."""

from dataclasses import replace

import numpy as np
import pytest

from core.key_phase import KeyPhase
from core.machine import Unit
from core.quality import Level, Reading, Reason, bad, missing
from core.settings import AnalysisSettings
from core.speed import Speed, SpeedSource, running_speed

FREQUENCY_HZ = np.arange(1, 300) * 600.0 / 8192
NO_LINE = np.ones(FREQUENCY_HZ.size)


def speed(unit: Unit, slow: Reading, pulses_rpm: float | None) -> Speed:
    key_phase = None if pulses_rpm is None else KeyPhase(1.0, pulses_rpm)
    with_pulses = replace(unit, key_phase="kp")
    settings = AnalysisSettings()
    return running_speed(with_pulses, {"speed": slow}, FREQUENCY_HZ, NO_LINE, settings, key_phase)


@pytest.mark.parametrize("slow", [Reading(92.2), missing(Reason.OUT_OF_RANGE)])
def test_good_pulses_are_preferred(unit: Unit, slow: Reading) -> None:
    found = speed(unit, slow, 92.3)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm == Reading(92.3)


@pytest.mark.parametrize("pulses_rpm", [None, 400.0], ids=["none", "no turbine reaches"])
def test_without_good_pulses_the_speed_channel_counts(unit: Unit, pulses_rpm: float | None) -> None:
    found = speed(unit, Reading(92.2), pulses_rpm)
    assert found.source is SpeedSource.SLOW_CHANNEL
    assert found.rpm == Reading(92.2)


@pytest.mark.parametrize("pulses_rpm", [184.6, 80.0])
def test_pulses_that_the_speed_channel_contradicts_are_doubted(
    unit: Unit, pulses_rpm: float
) -> None:
    found = speed(unit, Reading(92.3), pulses_rpm)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm.quality.level is Level.UNCERTAIN
    assert found.rpm.quality.reason is Reason.SPEED_IMPLAUSIBLE


def test_pulses_far_below_the_rated_speed_are_standstill(unit: Unit) -> None:
    found = speed(unit, missing(Reason.OUT_OF_RANGE), 15.0)
    assert found.source is SpeedSource.KEY_PHASE
    assert found.rpm.quality == bad(Reason.STANDSTILL)
