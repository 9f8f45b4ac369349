"""Checks of single channels over short cells of consecutive samples, before calibration.

A cell is shorter than a turn of the shaft, so its mean follows the vibration. A mean outside the OK
limits is therefore only uncertain; the checks of a whole segment decide.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import BoolArray, FloatArray, IntArray, RawArray
from core.quality import GOOD, Level, Quality, Reason, bad, uncertain

COUNTS_FULL_SCALE = 32768
"""Counts of a 16-bit converter at its full-scale voltage."""

VerdictArray = npt.NDArray[np.uint8]
"""Verdicts (n_channels, n_cells) as indices of `VERDICTS`."""

VERDICTS: tuple[Quality, ...] = (
    GOOD,
    *(make(reason) for make in (uncertain, bad) for reason in Reason),
)
"""All qualities. The values of a `VerdictArray` are indices of this tuple; index 0 is good."""

VERDICT_OF = {quality: number for number, quality in enumerate(VERDICTS)}
_LEVELS = np.array([list(Level).index(quality.level) for quality in VERDICTS], dtype=np.uint8)
_OUTSIDE = VERDICT_OF[uncertain(Reason.SENSOR_FAILURE)]
_CLIPPED = VERDICT_OF[bad(Reason.CLIPPED)]
_FAILED = VERDICT_OF[bad(Reason.SENSOR_FAILURE)]
NOT_FINITE = VERDICT_OF[bad(Reason.NOT_FINITE)]


@dataclass(frozen=True)
class ChannelLimits:
    """Full-scale and OK voltages of channels, and engineering units per volt: (n_channels, 1)."""

    full_scale_v: FloatArray
    unit_per_v: FloatArray
    ok_min_v: FloatArray
    ok_max_v: FloatArray


def channel_verdicts(
    samples: RawArray,
    starts: IntArray,
    is_ok: BoolArray,
    limits: ChannelLimits,
) -> VerdictArray:
    """Return the verdict on each channel in each cell, from status, clipping and OK limits.

    Parameters
    ----------
    samples : (n_channels, n_samples)
        Samples as int16 counts or float32 engineering units; at least one sample in each cell.
    starts : (n_cells,)
        Index of the first sample of each cell (run of samples with one OK state), rising from 0.
    is_ok : (n_channels, n_cells)
        Whether the device reports the channel as OK.

    Returns
    -------
    Indices of `VERDICTS` (n_channels, n_cells).
    """
    lowest = np.minimum.reduceat(samples, starts, axis=1)
    highest = np.maximum.reduceat(samples, starts, axis=1)
    length = np.append(starts[1:], samples.shape[1]) - starts
    if samples.dtype == np.int16:
        total = np.add.reduceat(samples, starts, axis=1, dtype=np.int64)
        mean_v = total / length * limits.full_scale_v / COUNTS_FULL_SCALE
        is_clipped = (lowest == -COUNTS_FULL_SCALE) | (highest == COUNTS_FULL_SCALE - 1)
        is_finite = None
    else:
        with np.errstate(invalid="ignore", over="ignore"):  # infinities have no finite mean
            total = np.add.reduceat(samples, starts, axis=1, dtype=np.float64)
            mean_v = total / length / limits.unit_per_v
        full_scale = np.abs(limits.full_scale_v * limits.unit_per_v)
        is_clipped = (-lowest >= full_scale) | (highest >= full_scale)
        is_finite = np.isfinite(lowest) & np.isfinite(highest)
    is_outside = ~((limits.ok_min_v <= mean_v) & (mean_v <= limits.ok_max_v))
    verdicts = np.zeros(is_ok.shape, dtype=np.uint8)
    verdicts[is_outside] = _OUTSIDE
    verdicts[is_clipped] = _CLIPPED
    verdicts[~is_ok | (is_outside & is_clipped)] = _FAILED
    if is_finite is not None:
        verdicts[~is_finite] = NOT_FINITE
    return verdicts


def worst_qualities(verdicts: VerdictArray) -> tuple[Quality, ...]:
    """Return the worst quality of each channel from verdicts (n_channels, n_cells)."""
    if not verdicts.any():
        return (GOOD,) * len(verdicts)
    first = _LEVELS[verdicts].argmax(axis=1)
    return tuple(VERDICTS[row[cell]] for row, cell in zip(verdicts, first, strict=True))
