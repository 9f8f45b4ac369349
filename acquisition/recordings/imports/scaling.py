"""When a file's integers are the converter's counts, and what its values are otherwise."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from acquisition.recordings.imports.job import ChannelColumn, ImportJob
from core.arrays import SampleArray

_SAME_GAIN = 1e-6
"""Gains that differ by less come from rounding in files; 24 bits cannot tell them apart."""


def counts_are_kept(job: ImportJob, per_count: Sequence[float | None]) -> bool:
    """Whether all columns have counts, with just the gain of their channel's calibration.

    Parameters
    ----------
    per_count
        Unit of the file per count of each column by the file itself; None if it does not say.
    """
    return all(
        gain is not None
        and math.isclose(gain * c.factor, c.calibrated_per_count, rel_tol=_SAME_GAIN)
        for c, gain in (
            (c, found or c.per_count) for c, found in zip(job.channels, per_count, strict=True)
        )
    )


def engineering_units(
    values: npt.NDArray[np.generic], channel: ChannelColumn, per_count: float | None
) -> SampleArray:
    """Values of a column in the unit of its channel; integers that are counts are scaled.

    Parameters
    ----------
    per_count
        As in :func:`counts_are_kept`.
    """
    gain = channel.factor * (per_count or channel.per_count or 1.0)
    with np.errstate(over="ignore"):  # beyond float32 is infinite, and so not finite
        return (values.astype(np.float64) * gain).astype(np.float32)
