"""Converter from engineering units to counts; failing transducers, cables and amplifiers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from core.arrays import CountArray, FloatArray
from core.checks.channels import COUNTS_FULL_SCALE
from core.samples.calibration import UnitCalibration

RAIL_HIT_SPACING = 997
"""Samples between two hits; a prime, so that hits fall anywhere in blocks."""

RAILS = (COUNTS_FULL_SCALE - 1, -COUNTS_FULL_SCALE)


class FaultKind(StrEnum):
    """Kind of failure of a channel."""

    DEAD = "dead"
    """No voltage: 0 counts."""
    STUCK = "stuck"
    """The last value from then on, ±1 count."""
    CLIPPED = "clipped"
    """The bias has drifted to the positive rail, which cuts off the upper half of the signal."""
    RAIL_HITS = "rail_hits"
    """A loose contact: single samples on one rail or the other."""


@dataclass(frozen=True)
class Fault:
    """Permanent failure of a channel.

    Parameters
    ----------
    from_sample
        Index of the first wrong sample.
    """

    kind: FaultKind
    from_sample: int = 0


class FaultInjector:
    """Applies faults to the counts of one stream.

    Parameters
    ----------
    faults
        By row of the counts; each applies to the result of those before.
    """

    def __init__(self, random: np.random.Generator, faults: Mapping[int, Sequence[Fault]]) -> None:
        self._random = random
        self._running = [(row, _Running(fault)) for row, found in faults.items() for fault in found]

    def spoil(self, counts: CountArray, first_index: int) -> None:
        """Apply the faults to the next counts of the stream, (n_channels, n_samples), in place."""
        for row, running in self._running:
            jitter = self._random.integers(-1, 2, (counts.shape[1],))
            running.spoil(counts[row], first_index, jitter)


@dataclass
class _Running:
    fault: Fault
    last: int | None = None
    """Sample before the fault; the first of all if the fault is there from the start."""

    def spoil(self, counts: CountArray, first_index: int, jitter: npt.NDArray[np.int64]) -> None:
        healthy = min(max(self.fault.from_sample - first_index, 0), counts.size)
        if healthy:
            self.last = int(counts[healthy - 1])
        if healthy < counts.size:
            last = int(counts[0]) if self.last is None else self.last
            since = np.arange(healthy, counts.size) + first_index - self.fault.from_sample
            broken = _broken(self.fault.kind, counts[healthy:], since, last, jitter[healthy:])
            counts[healthy:] = broken
            self.last = last


def _broken(
    kind: FaultKind,
    counts: CountArray,
    since: npt.NDArray[np.int64],
    last: int,
    jitter: npt.NDArray[np.int64],
) -> CountArray:
    upper, lower = RAILS
    wide = counts.astype(np.int64)
    match kind:
        case FaultKind.DEAD:
            wide = np.zeros_like(wide)
        case FaultKind.STUCK:
            wide = last + jitter
        case FaultKind.CLIPPED:
            wide = wide + (upper - last)
        case FaultKind.RAIL_HITS:
            hit, turn = since % RAIL_HIT_SPACING == 0, since // RAIL_HIT_SPACING % 2
            wide[hit] = np.array(RAILS)[turn[hit]]
    return wide.clip(lower, upper).astype(np.int16)


def to_counts(readings: FloatArray, calibration: UnitCalibration) -> CountArray:
    """Convert readings to whole counts, clipped at the rails.

    Parameters
    ----------
    readings
        (n_channels, n_samples) in engineering units.
    """
    per_unit = np.array([1.0 / channel.unit_per_count for channel in calibration.channels])
    counts: FloatArray = np.rint(readings * per_unit[:, np.newaxis])
    return counts.clip(-COUNTS_FULL_SCALE, COUNTS_FULL_SCALE - 1, out=counts).astype(np.int16)
