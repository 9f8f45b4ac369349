"""Samples as a device delivers them, and their engineering units; the same for every adapter."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from core.arrays import RawArray, SampleArray
from core.quality import GOOD, Quality, Reading, Reason, bad, missing, uncertain
from core.samples.blocks import Rejection, SampleBlock


@dataclass(frozen=True)
class RawBlock:
    """Consecutive samples as a device delivers them.

    Parameters
    ----------
    counts
        (n_channels, n_samples) int16 counts of the converter; or, from a device that has none,
        float32 engineering units, not a number where the device has no sample.
    start_ns
        Time of the first sample, by the device's stamps or by the host's clock.
    ok
        (n_channels,) the device's own verdict on each channel.
    slow
        One value for each configured slow channel, NaN where the device has none.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    counts: RawArray
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...] = ()

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return int(self.counts.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples


COUNTS_FULL_SCALE = 32768
"""Counts of a 16-bit converter that stand for its full-scale voltage."""

BLOCK_SAMPLES = 50
"""A twelfth of a second at 600 Hz: how long a probe can be lost before anybody is told."""


@dataclass(frozen=True)
class ChannelCalibration:
    """How the counts of one waveform channel become its engineering unit.

    Parameters
    ----------
    full_scale_v
        Converter input voltage at 32768 counts.
    unit_per_v
        Engineering units per volt: the reciprocal of the transducer's sensitivity.
    ok_min_v, ok_max_v
        The mean voltage of a healthy transducer lies between these (gap OK limits), over turns of
        the shaft.
    """

    full_scale_v: float
    unit_per_v: float
    ok_min_v: float
    ok_max_v: float

    @property
    def unit_per_count(self) -> float:
        """Engineering units per count."""
        return self.full_scale_v / COUNTS_FULL_SCALE * self.unit_per_v

    @property
    def ok_limits(self) -> tuple[float, float]:
        """Lowest and highest mean of a healthy transducer, engineering units."""
        ends = (self.ok_min_v * self.unit_per_v, self.ok_max_v * self.unit_per_v)
        return min(ends), max(ends)


@dataclass(frozen=True)
class SlowCalibration:
    """Name and plausible range of one slow channel."""

    id: str
    minimum: float
    maximum: float


@dataclass(frozen=True)
class UnitCalibration:
    """Everything needed to read one unit's device, in wire order.

    Parameters
    ----------
    block_samples
        Samples of each channel in a block: they share one verdict on each channel and one set of
        slow values. Blocks begin at multiples of it, so that the same samples are judged the same
        way whatever the wire cuts them into.
    """

    unit: str
    rate_hz: float
    channels: tuple[ChannelCalibration, ...]
    slow: tuple[SlowCalibration, ...]
    block_samples: int = BLOCK_SAMPLES


def calibrate(raw: RawBlock, calibration: UnitCalibration) -> SampleBlock:
    """Turn what a device delivered into engineering units, its flags into qualities.

    The result is bit-identical for identical raw blocks, whichever adapter carried them.
    """
    return SampleBlock(
        unit=calibration.unit,
        epoch=raw.epoch,
        first_index=raw.first_index,
        start_ns=raw.start_ns,
        rate_hz=raw.rate_hz,
        samples=_engineering_units(raw, calibration),
        channel_quality=_channel_qualities(raw, calibration.channels),
        slow={c.id: slow_reading(v, c) for c, v in zip(calibration.slow, raw.slow, strict=True)},
        rejected=raw.rejected,
    )


def _engineering_units(raw: RawBlock, calibration: UnitCalibration) -> SampleArray:
    if raw.counts.dtype == np.float32:
        # one NaN would blind a whole spectrum; the channel is bad for this block, and says so
        finite = np.isfinite(raw.counts).all(axis=1, keepdims=True)
        return np.where(finite, raw.counts, np.float32(0.0))
    gain = np.array([c.unit_per_count for c in calibration.channels], dtype=np.float32)
    samples = raw.counts.astype(np.float32)
    samples *= gain[:, np.newaxis]
    return samples


def _channel_qualities(
    raw: RawBlock, channels: Iterable[ChannelCalibration]
) -> tuple[Quality, ...]:
    lowest = raw.counts.min(axis=1)
    highest = raw.counts.max(axis=1)
    with np.errstate(invalid="ignore"):  # infinities of both signs have no mean
        mean = raw.counts.mean(axis=1, dtype=np.float64)
    judge = _quality_of_units if raw.counts.dtype == np.float32 else _quality_of_counts
    return tuple(
        judge(c, ok, float(lo), float(hi), float(m))
        for c, ok, lo, hi, m in zip(channels, raw.ok, lowest, highest, mean, strict=True)
    )


def _quality_of_counts(
    channel: ChannelCalibration, ok: bool, lowest: float, highest: float, mean: float
) -> Quality:
    mean_v = mean * channel.full_scale_v / COUNTS_FULL_SCALE
    is_clipped = lowest == -COUNTS_FULL_SCALE or highest == COUNTS_FULL_SCALE - 1
    return _judged(channel, ok, mean_v, is_clipped)


def _quality_of_units(
    channel: ChannelCalibration, ok: bool, lowest: float, highest: float, mean: float
) -> Quality:
    if not np.isfinite(lowest) or not np.isfinite(highest):
        return bad(Reason.NOT_FINITE)
    full_scale = abs(channel.full_scale_v * channel.unit_per_v)
    is_clipped = max(-lowest, highest) >= full_scale
    return _judged(channel, ok, mean / channel.unit_per_v, is_clipped)


def _judged(channel: ChannelCalibration, ok: bool, mean_v: float, is_clipped: bool) -> Quality:
    """Verdict of one block, which is shorter than a turn: its mean follows the vibration.

    A mean outside the OK limits is therefore no more than a doubt, which the segment decides.
    """
    is_outside = not channel.ok_min_v <= mean_v <= channel.ok_max_v
    if not ok or (is_outside and is_clipped):
        return bad(Reason.SENSOR_FAILURE)
    if is_clipped:
        return bad(Reason.CLIPPED)
    return uncertain(Reason.SENSOR_FAILURE) if is_outside else GOOD


def slow_reading(value: float, channel: SlowCalibration) -> Reading:
    """A slow value as far as it may be believed."""
    if not np.isfinite(value):
        return missing(Reason.NOT_MEASURED)
    if not channel.minimum <= value <= channel.maximum:
        return missing(Reason.OUT_OF_RANGE)
    return Reading(float(value))
