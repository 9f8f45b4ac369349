"""Calibrated blocks back to raw blocks, exactly or not at all."""

import math

import numpy as np
import numpy.typing as npt

from acquisition.delivery.calibration import (
    COUNTS_FULL_SCALE,
    RawBlock,
    SlowCalibration,
    UnitCalibration,
    calibrate,
)
from acquisition.errors import ConfigError
from core.arrays import CountArray, RawArray, SampleArray
from core.quality import Reading, Reason, bad
from core.samples.blocks import SampleBlock

INT16 = np.dtype(np.int16)


def raw_of(
    block: SampleBlock, calibration: UnitCalibration, dtype: npt.DTypeLike = INT16
) -> RawBlock:
    """Find the raw block from which `calibrate` makes exactly this block.

    Judgements of `calibrate` stay: a failed channel is not OK, a channel with a sample that is not
    finite has no samples, and a slow value out of range is one just above its range.

    Parameters
    ----------
    dtype
        int16 for the counts of a converter, float32 for engineering units.

    Raises
    ------
    ConfigError
        If there is none: the calibration was another, or the samples were never counts.
    """
    if len(calibration.channels) != len(block.samples):
        raise _not_found(block, dtype)
    raw = RawBlock(
        epoch=block.epoch,
        first_index=block.first_index,
        start_ns=block.start_ns,
        rate_hz=block.rate_hz,
        counts=_samples(block, calibration, dtype),
        ok=tuple(q != bad(Reason.SENSOR_FAILURE) for q in block.channel_quality),
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
        raise _not_found(block, dtype)
    return raw


def _samples(block: SampleBlock, calibration: UnitCalibration, dtype: npt.DTypeLike) -> RawArray:
    return _counts(block, calibration) if dtype == INT16 else _units(block)


def _counts(block: SampleBlock, calibration: UnitCalibration) -> CountArray:
    gain = np.array([c.unit_per_count for c in calibration.channels], dtype=np.float32)
    counts = np.rint(block.samples.astype(np.float64) / gain[:, np.newaxis])
    # written so that NaN fails it, too
    if not np.all((counts >= -COUNTS_FULL_SCALE) & (counts < COUNTS_FULL_SCALE)):
        raise _not_found(block, INT16)
    return counts.astype(np.int16)


def _units(block: SampleBlock) -> SampleArray:
    """Engineering units; NaN in a channel that had a sample that was not finite."""
    blanked = [quality.reason is Reason.NOT_FINITE for quality in block.channel_quality]
    return np.where(np.array(blanked)[:, np.newaxis], np.float32(np.nan), block.samples)


def _slow_value(reading: Reading | None, channel: SlowCalibration) -> float:
    if reading is None or reading.quality.reason is Reason.NOT_MEASURED:
        return math.nan
    if reading.value is None:
        # the next larger number in single precision, in which slow values are sent
        return float(np.nextafter(np.float32(channel.maximum), np.float32(np.inf)))
    return reading.value


def _not_found(block: SampleBlock, dtype: npt.DTypeLike) -> ConfigError:
    kind = "of a 16-bit converter" if dtype == INT16 else "in engineering units"
    return ConfigError(
        f"the samples of unit {block.unit!r} from index {block.first_index} on are not those"
        f" {kind} with the calibration they are to be recorded with"
    )
