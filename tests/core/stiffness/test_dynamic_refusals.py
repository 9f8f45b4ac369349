"""Without evidence of the film there is a reason, never a stiffness."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigs.shaken_shaft import BRACKET, FREQUENCY_HZ, NOISE_FREE, TURN_HZ, averaged

from core.arrays import ComplexArray
from core.quality import Reason
from core.spectra.cross_spectrum import average
from core.stiffness.dynamic import DynamicStiffness, dynamic_stiffness
from core.stiffness.dynamic_lines import DynamicSettings

Recording = Callable[..., ComplexArray]


def test_noise_alone_or_motion_along_one_line_is_insufficient_and_never_a_stiffness(
    recording: Recording,
) -> None:
    for seed in range(30):
        noise = averaged(recording(seed, motion_um=0.0, probe_um=0.1, bearing_um=0.3))
        result = dynamic_stiffness(noise, BRACKET, TURN_HZ, DynamicSettings())
        assert result is Reason.INSUFFICIENT_EXCITATION
    phasors = recording(bearing_um=0.1)
    phasors[:, 1] = 0.5 * phasors[:, 0]
    result = dynamic_stiffness(averaged(phasors), BRACKET, TURN_HZ, DynamicSettings())
    assert result is Reason.INSUFFICIENT_EXCITATION


@pytest.mark.parametrize("channel", range(4))
def test_a_dead_channel_is_never_a_stiffness(recording: Recording, channel: int) -> None:
    phasors = recording(probe_um=0.01, bearing_um=0.1)
    phasors[:, channel] = 0.0
    result = dynamic_stiffness(averaged(phasors), BRACKET, TURN_HZ, DynamicSettings())
    assert result is Reason.INSUFFICIENT_EXCITATION


def test_channels_of_different_segments_are_refused(recording: Recording) -> None:
    usable = np.ones((24, 4), dtype=bool)
    usable[0, 2] = False
    spectrum = average(FREQUENCY_HZ, recording(), usable)
    with pytest.raises(ValueError, match="different segments"):
        dynamic_stiffness(spectrum, BRACKET, TURN_HZ, NOISE_FREE)


@pytest.mark.parametrize(
    "stricter",
    [{"min_signal_share": 0.999}, {"max_relative_uncertainty": 1e-4}, {"min_coherence": 0.9999}],
)
def test_each_demand_on_the_evidence_can_refuse_alone(
    recording: Recording, stricter: dict[str, float]
) -> None:
    spectrum = averaged(recording(probe_um=0.1, bearing_um=0.1))
    base = DynamicSettings()

    assert isinstance(dynamic_stiffness(spectrum, BRACKET, TURN_HZ, base), DynamicStiffness)
    strict = replace(base, **stricter)
    result = dynamic_stiffness(spectrum, BRACKET, TURN_HZ, strict)
    assert result is Reason.INSUFFICIENT_EXCITATION
