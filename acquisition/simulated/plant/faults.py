"""Conversion of readings to counts, and faults of transducers, cables and amplifiers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from core.arrays import CountArray, FloatArray
from core.checks.channels import COUNTS_FULL_SCALE
from core.samples.calibration import UnitCalibration

RAIL_HIT_SPACING = 997
"""Number of samples between two rail hits; a prime, so that their position in blocks varies."""

RAILS = (COUNTS_FULL_SCALE - 1, -COUNTS_FULL_SCALE)


class FaultKind(StrEnum):
    """Kind of a channel fault."""

    DEAD = "dead"
    """No voltage: all samples are 0 counts."""
    STUCK = "stuck"
    """All samples are the last value before the fault, ±1 count."""
    CLIPPED = "clipped"
    """The bias is at the positive rail, which clips the upper half of the signal."""
    RAIL_HITS = "rail_hits"
    """A loose contact: single samples are at the positive or negative rail."""


@dataclass(frozen=True)
class Fault:
    """Permanent fault of a channel.

    `from_sample` is the index of the first faulty sample.
    """

    kind: FaultKind
    from_sample: int = 0


class FaultInjector:
    """Injector of permanent channel faults into the converter counts of one unit.

    `faults` contains the faults by channel row of the counts; those of one channel are applied in
    sequence.
    """

    def __init__(self, random: np.random.Generator, faults: Mapping[int, Sequence[Fault]]) -> None:
        self._random = random
        self._running = [(row, _Running(fault)) for row, found in faults.items() for fault in found]

    def spoil(self, counts: CountArray, first_index: int) -> None:
        """Apply the faults to counts (n_channels, n_samples) from `first_index` on, in place."""
        for row, running in self._running:
            jitter = self._random.integers(-1, 2, (counts.shape[1],))
            running.spoil(counts[row], first_index, jitter)


@dataclass
class _Running:
    fault: Fault
    last: int | None = None
    """Last count before the fault; the first count if the fault begins at the first sample."""

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
    """Convert readings to int16 counts, rounded and clipped to the range of the converter.

    `readings` are (n_channels, n_samples) in engineering units.
    """
    per_unit = np.array([1.0 / channel.unit_per_count for channel in calibration.channels])
    counts: FloatArray = np.rint(readings * per_unit[:, np.newaxis])
    return counts.clip(-COUNTS_FULL_SCALE, COUNTS_FULL_SCALE - 1, out=counts).astype(np.int16)
