"""Vibration of the newest parts of a segment, by which limits of fast changes are judged.

Averages over minutes show a step minutes later. The parts of a segment show it within seconds, and
for how long it has lasted.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.quality import Reading

MAX_PARTS = 4
"""Of what a segment adds to the one before; 3 s each at the defaults."""

PART_TURNS = 4.0
"""Turns in a part, at least: the main lobe of Hann's taper then reaches half an order from 1×
(Harris 1978), short of the vortex at 0.2 to 0.4 orders."""


@dataclass(frozen=True)
class RecentVibration:
    """The newest parts of one segment, oldest first.

    Parameters
    ----------
    stop : (n_parts,)
        Sample behind each part, counted from the segment's first.
    order1_um_pk : (n_parts, n_channels)
        Displacement amplitudes at 1×, without runout where that can be taken off.
    peak_to_peak_um : (n_parts, n_channels)
        Of the samples as they are; only of channels that measure displacement.
    """

    stop: npt.NDArray[np.int64]
    order1_um_pk: FloatArray
    peak_to_peak_um: FloatArray


@dataclass(frozen=True)
class RecentReadings:
    """Some quantities of one bearing, of the samples just before a moment alone."""

    time_ns: int
    readings: Mapping[str, Reading]


def parts_of(
    n_samples: int, hop_samples: int, turn_samples: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """First sample of each part of a segment, and the one behind it.

    They cover what the segment adds to the one before; a part is as long as its turns need, so
    that it may begin earlier.

    Parameters
    ----------
    hop_samples
        Samples from one segment's start to the next one's.
    turn_samples
        Samples in a turn of the shaft.
    """
    n_parts = int(np.clip(hop_samples / (PART_TURNS * turn_samples), 1, MAX_PARTS))
    stop = n_samples - hop_samples + hop_samples * np.arange(1, n_parts + 1) // n_parts
    length = max(hop_samples // n_parts, round(PART_TURNS * turn_samples))
    return np.maximum(stop - length, 0), stop
