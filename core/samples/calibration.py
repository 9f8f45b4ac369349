"""Calibration of one unit's device: conversion of counts to engineering units."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.arrays import FloatArray, IntArray, RawArray, SampleArray
from core.checks.channels import COUNTS_FULL_SCALE, ChannelLimits
from core.quality import Reading, Reason, mean_reading, missing

BLOCK_SAMPLES = 50
"""Default number of samples per cell: 1/12 s at 600 Hz, the shortest visible probe failure."""

_LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class ChannelCalibration:
    """Calibration of one waveform channel: counts to engineering units.

    Parameters
    ----------
    full_scale_v
        Converter input voltage at 32768 counts.
    unit_per_v
        Engineering units per volt: the reciprocal of the transducer's sensitivity.
    ok_min_v, ok_max_v
        Limits of a healthy transducer's mean voltage over turns of the shaft (gap OK limits).
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
        """Lowest and highest mean signal of a healthy transducer, in engineering units."""
        ends = (self.ok_min_v * self.unit_per_v, self.ok_max_v * self.unit_per_v)
        return min(ends), max(ends)


UNLIMITED = ChannelCalibration(
    full_scale_v=_LARGEST, unit_per_v=1.0, ok_min_v=-float("inf"), ok_max_v=float("inf")
)
"""Calibration of samples in engineering units from a device, such as a rack, that checks its
transducers itself."""


@dataclass(frozen=True)
class SlowCalibration:
    """Calibration of one slow channel: its id, and its plausible range in the channel's unit."""

    id: str
    minimum: float
    maximum: float

    def reading(self, value: float) -> Reading:
        """Return a value of the channel as a reading; bad if not finite or out of range."""
        if not math.isfinite(value):
            return missing(Reason.NOT_MEASURED)
        if not self.minimum <= value <= self.maximum:
            return missing(Reason.OUT_OF_RANGE)
        return Reading(float(value))

    def mean(self, values: FloatArray, weights: IntArray) -> Reading:
        """Return the weighted mean of slow values; equals `core.quality.mean_reading` bit by bit.

        Parameters
        ----------
        values : (n,)
            Slow values, oldest first; at least one.
        weights : (n,)
            Number of samples for which each value holds.
        """
        is_known = np.isfinite(values) & (self.minimum <= values) & (values <= self.maximum)
        if not is_known.all():
            readings = [self.reading(value) for value in values.tolist()]
            return mean_reading(readings, weights.tolist())
        newest = float(values[-1])
        shift = sum((weights * (values - newest)).tolist())
        return Reading(newest + shift / int(weights.sum()))


@dataclass(frozen=True)
class UnitCalibration:
    """Calibration of one unit's device, with the channels in the order of the device.

    `rate_hz` is the sampling rate of each waveform channel. Samples are divided into cells of
    `block_samples` samples, which share one OK state per channel and one set of slow values. Cells
    begin at multiples of this number, so that they do not depend on the messages of the device.
    """

    unit: str
    rate_hz: float
    channels: tuple[ChannelCalibration, ...]
    slow: tuple[SlowCalibration, ...]
    block_samples: int = BLOCK_SAMPLES

    @cached_property
    def limits(self) -> ChannelLimits:
        """OK limits and full scales of all channels as arrays."""
        rows = [(c.full_scale_v, c.unit_per_v, c.ok_min_v, c.ok_max_v) for c in self.channels]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 4, 1)
        return ChannelLimits(*columns.swapaxes(0, 1))

    @cached_property
    def slow_ids(self) -> tuple[str, ...]:
        """Ids of the slow channels."""
        return tuple(channel.id for channel in self.slow)

    @cached_property
    def _gain(self) -> SampleArray:
        gain = np.array([c.unit_per_count for c in self.channels], dtype=np.float32)
        return gain[:, np.newaxis]

    def to_units(self, counts: RawArray) -> SampleArray:
        """Convert int16 counts (n_channels, n_samples) to engineering units, as float32.

        Samples that are float32 already are in engineering units, and are returned unchanged.
        """
        samples = counts.astype(np.float32, copy=False)
        if samples is counts:
            return samples
        samples *= self._gain
        return samples
