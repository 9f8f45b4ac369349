"""Calibration of one unit's device: counts of its converter to engineering units."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, RawArray, SampleArray
from core.checks.channels import COUNTS_FULL_SCALE, ChannelLimits
from core.quality import Reading, Reason, mean_reading, missing

BLOCK_SAMPLES = 50
"""A twelfth of a second at 600 Hz: the shortest time for which a lost probe is reported."""

_LARGEST = float(np.finfo(np.float32).max)


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
        Limits of the mean voltage of a healthy transducer over turns of the shaft (gap OK limits).
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


UNLIMITED = ChannelCalibration(
    full_scale_v=_LARGEST, unit_per_v=1.0, ok_min_v=-float("inf"), ok_max_v=float("inf")
)
"""Of engineering units whose device judges its transducers itself, such as a rack."""


@dataclass(frozen=True)
class SlowCalibration:
    """Name and plausible range of one slow channel."""

    id: str
    minimum: float
    maximum: float

    def reading(self, value: float) -> Reading:
        """A slow value with its quality: missing if it is not finite or out of range."""
        if not np.isfinite(value):
            return missing(Reason.NOT_MEASURED)
        if not self.minimum <= value <= self.maximum:
            return missing(Reason.OUT_OF_RANGE)
        return Reading(float(value))

    def mean(self, values: FloatArray, weights: npt.NDArray[np.int64]) -> Reading:
        """Mean of slow values, to the last bit as `core.quality.mean_reading` of their readings.

        Parameters
        ----------
        values : (n,)
            Oldest first.
        weights : (n,)
            Samples for which each of them holds.
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
    """Everything needed to read one unit's device, in wire order.

    Parameters
    ----------
    block_samples
        Samples of each channel that share one verdict on each channel and one set of slow values.
        They begin at multiples of it, so that the same samples are judged the same way however
        the wire cuts them.
    """

    unit: str
    rate_hz: float
    channels: tuple[ChannelCalibration, ...]
    slow: tuple[SlowCalibration, ...]
    block_samples: int = BLOCK_SAMPLES

    @cached_property
    def limits(self) -> ChannelLimits:
        """Limits of all channels as arrays."""
        return ChannelLimits.of(
            [(c.full_scale_v, c.unit_per_v, c.ok_min_v, c.ok_max_v) for c in self.channels]
        )

    @cached_property
    def slow_ids(self) -> tuple[str, ...]:
        """Ids of the slow channels."""
        return tuple(channel.id for channel in self.slow)

    @cached_property
    def _gain(self) -> SampleArray:
        gain = np.array([c.unit_per_count for c in self.channels], dtype=np.float32)
        return gain[:, np.newaxis]

    def to_units(self, counts: RawArray) -> SampleArray:
        """Engineering units of int16 counts; float32 samples are engineering units already.

        Parameters
        ----------
        counts : (n_channels, n_samples)
        """
        samples = counts.astype(np.float32, copy=False)
        if samples is counts:
            return samples
        samples *= self._gain
        return samples
