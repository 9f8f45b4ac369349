"""What counts and engineering units say about their own channel."""

import math

import numpy as np
import pytest

from acquisition.delivery.blocks import RawBlock, sample_block
from core.quality import GOOD, Quality, Reason, bad, uncertain
from core.samples.calibration import ChannelCalibration, UnitCalibration

PROBE = ChannelCalibration(10.0, -250.0, -9.0, 9.0)
"""10 V are 2500 µm; on average from -9 to 9 V, which is 29,491 counts or 2250 µm."""


def judged(samples: np.ndarray, ok: bool = True) -> Quality:
    raw = RawBlock(1, 0, 0, 600.0, samples[np.newaxis], (ok,), ())
    return sample_block([raw], UnitCalibration("U1", 600.0, (PROBE,), ())).channel_quality[0]


@pytest.mark.parametrize(
    ("dtype", "samples", "expected"),
    [
        (np.int16, [0, 32766], GOOD),
        (np.int16, [0, 32767], bad(Reason.CLIPPED)),
        (np.int16, [0, -32767], GOOD),
        (np.int16, [0, -32768], bad(Reason.CLIPPED)),
        (np.int16, [29_491, 29_491], GOOD),
        (np.int16, [29_492, 29_492], uncertain(Reason.SENSOR_FAILURE)),
        (np.int16, [-29_492, -29_492], uncertain(Reason.SENSOR_FAILURE)),
        (np.int16, [32_767, 32_767], bad(Reason.SENSOR_FAILURE)),
        (np.float32, [0.0, 2499.0], GOOD),
        (np.float32, [0.0, 2500.0], bad(Reason.CLIPPED)),
        (np.float32, [0.0, -2500.0], bad(Reason.CLIPPED)),
        (np.float32, [2249.0, 2249.0], GOOD),
        (np.float32, [2251.0, 2251.0], uncertain(Reason.SENSOR_FAILURE)),
        (np.float32, [-2251.0, -2251.0], uncertain(Reason.SENSOR_FAILURE)),
        (np.float32, [2500.0, 2500.0], bad(Reason.SENSOR_FAILURE)),
        (np.float32, [0.0, math.inf], bad(Reason.NOT_FINITE)),
        (np.float32, [0.0, math.nan], bad(Reason.NOT_FINITE)),
    ],
)
def test_a_channel_is_judged_by_its_samples(
    dtype: type, samples: list[float], expected: Quality
) -> None:
    """A block is shorter than a turn: that its mean is outside the OK limits is only a doubt."""
    assert judged(np.array(samples, dtype)) == expected


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_a_channel_that_its_device_calls_bad_has_failed(dtype: type) -> None:
    assert judged(np.zeros(5, dtype), ok=False) == bad(Reason.SENSOR_FAILURE)
