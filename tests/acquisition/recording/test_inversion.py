"""Counts are found again behind engineering units, or the block is refused."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acquisition.calibration import (
    ChannelCalibration,
    SlowCalibration,
    UnitCalibration,
    calibrate,
)
from acquisition.errors import ConfigError
from acquisition.raw import RawBlock
from acquisition.recording.inversion import raw_of
from acquisition.recording.manifest import RecordedUnit
from core.arrays import CountArray, SampleArray

Numbered = Callable[..., RawBlock]
EVERY_COUNT = np.arange(-32768, 32768, dtype=np.int16)


@settings(deadline=None)
@given(st.floats(1e-3, 100.0), st.floats(1e-6, 1e6), st.sampled_from([1.0, -1.0]))
def test_every_count_is_found_again_whatever_the_gain(
    full_scale_v: float, unit_per_v: float, sign: float
) -> None:
    channel = ChannelCalibration(full_scale_v, sign * unit_per_v, -200.0, 200.0)
    calibration = UnitCalibration("U1", 600.0, (channel,), ())
    raw = RawBlock(1, 0, 0, 600.0, EVERY_COUNT[np.newaxis], (True,), ())
    found = raw_of(calibrate(raw, calibration), calibration)
    assert found.counts.dtype == np.int16
    np.testing.assert_array_equal(found.counts, raw.counts)


@given(
    st.one_of(arrays(np.int16, (2, 5)), arrays(np.float32, (2, 5), elements=st.floats(width=32))),
    st.tuples(st.booleans(), st.booleans()),
    st.tuples(st.floats(), st.floats(-11.0, 121.0)),
)
def test_what_was_judged_is_judged_the_same_again(
    samples: CountArray | SampleArray, ok: tuple[bool, bool], slow: tuple[float, float]
) -> None:
    channel = ChannelCalibration(12.0, 250.0, 1.0, 11.0)
    limits = (SlowCalibration("a", -10.0, 120.0), SlowCalibration("b", -10.0, 120.0))
    calibration = UnitCalibration("U1", 600.0, (channel, channel), limits)
    block = calibrate(RawBlock(1, 0, 0, 600.0, samples, ok, slow), calibration)
    raw = raw_of(block, calibration, samples.dtype)
    assert raw.counts.dtype == samples.dtype
    again = calibrate(raw, calibration)
    assert again.channel_quality == block.channel_quality
    assert again.slow == block.slow
    assert again.samples.tobytes() == block.samples.tobytes()


@pytest.mark.parametrize("wrong", [0.5, math.nan, math.inf, 1e6])
def test_samples_that_never_were_counts_are_refused(
    unit: RecordedUnit, numbered: Numbered, wrong: float
) -> None:
    block = calibrate(numbered(70, 5), unit.calibration)
    block.samples[1, 2] += np.float32(wrong) * np.float32(250.0 * 12.0 / 32768)
    with pytest.raises(ConfigError, match="'U1' from index 70 on are not those of a 16-bit"):
        raw_of(block, unit.calibration)


def test_another_unit_or_calibration_is_refused(unit: RecordedUnit, numbered: Numbered) -> None:
    block = calibrate(numbered(0, 5), unit.calibration)
    for other in (
        replace(unit.calibration, unit="U2"),
        replace(unit.calibration, slow=unit.calibration.slow[:1]),
        replace(unit.calibration, channels=unit.calibration.channels[:1]),
        replace(
            unit.calibration,
            channels=tuple(replace(c, unit_per_v=-251.0) for c in unit.calibration.channels),
        ),
    ):
        with pytest.raises(ConfigError, match="not those"):
            raw_of(block, other)


def test_a_channel_with_a_sample_that_was_none_has_none_in_the_recording(
    unit: RecordedUnit, numbered: Numbered
) -> None:
    samples = np.array([[100.0, math.nan, 100.0], [200.0, 200.0, 200.0]], np.float32)
    block = calibrate(numbered(0, 3, counts=samples), unit.calibration)
    raw = raw_of(block, unit.calibration, np.float32)
    assert np.isnan(raw.counts[0]).all()
    np.testing.assert_array_equal(raw.counts[1], samples[1])
