"""From engineering units back to counts, exactly or not at all."""

import math

import numpy as np

from acquisition.calibration import (
    COUNTS_FULL_SCALE,
    SlowCalibration,
    UnitCalibration,
    calibrate,
)
from acquisition.errors import ConfigError
from acquisition.raw import RawBlock
from core.arrays import CountArray
from core.blocks import SampleBlock
from core.quality import Reading, Reason


def raw_of(block: SampleBlock, calibration: UnitCalibration) -> RawBlock:
    """Find the counts that :func:`acquisition.calibration.calibrate` makes this very block of.

    What `calibrate` has already judged is given back as judged: a channel that has failed is not
    OK, a slow value that was out of range lies just above it.

    Raises
    ------
    ConfigError
        If there are no such counts: the block was calibrated otherwise, or never was counts.
    """
    raw = RawBlock(
        epoch=block.epoch,
        first_index=block.first_index,
        start_ns=block.start_ns,
        rate_hz=block.rate_hz,
        counts=_counts(block, calibration),
        ok=tuple(q.reason is not Reason.SENSOR_FAILURE for q in block.channel_quality),
        slow=tuple(_slow_value(block.slow.get(c.id), c) for c in calibration.slow),
        rejected=block.rejected,
    )
    again = calibrate(raw, calibration)
    if (
        not np.array_equal(again.samples, block.samples)
        or again.channel_quality != block.channel_quality
        or again.slow != block.slow
        or again.unit != block.unit
    ):
        raise _not_counts(block)
    return raw


def _counts(block: SampleBlock, calibration: UnitCalibration) -> CountArray:
    if len(calibration.channels) != len(block.samples):
        raise _not_counts(block)
    gain = np.array([c.unit_per_count for c in calibration.channels], dtype=np.float32)
    counts = np.rint(block.samples.astype(np.float64) / gain[:, np.newaxis])
    # written so that NaN fails it, too
    if not np.all((counts >= -COUNTS_FULL_SCALE) & (counts < COUNTS_FULL_SCALE)):
        raise _not_counts(block)
    return counts.astype(np.int16)


def _slow_value(reading: Reading | None, channel: SlowCalibration) -> float:
    if reading is None or reading.quality.reason is Reason.NOT_MEASURED:
        return math.nan
    if reading.value is None:
        return math.nextafter(channel.maximum, math.inf)
    return reading.value


def _not_counts(block: SampleBlock) -> ConfigError:
    return ConfigError(
        f"the samples of unit {block.unit!r} from index {block.first_index} on are not those of a"
        " 16-bit converter with the calibration they are to be recorded with"
    )
