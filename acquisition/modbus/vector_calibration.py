"""How the rows of a vector rack are judged: only a gap has limits of a transducer."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from acquisition.delivery.calibration import ChannelCalibration, UnitCalibration
from core.spectra.polls import VectorPart, VectorRow

_UNLIMITED = ChannelCalibration(
    full_scale_v=float(np.finfo(np.float32).max),
    unit_per_v=1.0,
    ok_min_v=-float("inf"),
    ok_max_v=float("inf"),
)
"""A rack states engineering units and judges its transducers itself."""


def vector_calibration(
    calibration: UnitCalibration, channels: Sequence[str], rows: Sequence[VectorRow]
) -> UnitCalibration:
    """Calibration of a unit whose blocks have one sample for each poll and a row for each vector.

    Parameters
    ----------
    calibration
        Of the unit's physical channels.
    channels
        Their ids, in the same order.

    Raises
    ------
    LookupError
        If a row is of a channel that is not there.
    """
    by_id: Mapping[str, ChannelCalibration] = dict(zip(channels, calibration.channels, strict=True))
    return replace(
        calibration,
        channels=tuple(
            by_id[row.channel] if row.part is VectorPart.GAP else _UNLIMITED for row in rows
        ),
        block_samples=1,
    )
