"""The converter of the data acquisition: engineering units become counts."""

import numpy as np

from acquisition.delivery.calibration import COUNTS_FULL_SCALE, UnitCalibration
from core.arrays import CountArray, FloatArray


def to_counts(readings: FloatArray, calibration: UnitCalibration) -> CountArray:
    """Round to whole counts and clip at the rails, as a converter does.

    Parameters
    ----------
    readings
        (n_channels, n_samples) in engineering units.
    """
    per_unit = np.array([1.0 / channel.unit_per_count for channel in calibration.channels])
    counts: FloatArray = np.rint(readings * per_unit[:, np.newaxis])
    return counts.clip(-COUNTS_FULL_SCALE, COUNTS_FULL_SCALE - 1, out=counts).astype(np.int16)
