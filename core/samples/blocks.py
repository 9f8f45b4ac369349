"""Sample blocks: the common data format of all acquisition adapters."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from core.arrays import BoolArray, FloatArray, IntArray, RawArray, SampleArray
from core.checks.channels import (
    NOT_FINITE,
    VERDICTS,
    VerdictArray,
    channel_verdicts,
    worst_qualities,
)
from core.quality import Quality, Reading
from core.samples.calibration import UnitCalibration
from core.units import NS_PER_S, ns_from_s

UNCOUNTED_LOSS = "uncounted_loss"
"""Rejection reason of lost samples that were not counted; their number is derived from time."""


@dataclass(frozen=True)
class Rejection:
    """Number of samples per channel that an adapter rejected directly before a block.

    The reason is in snake case and is used as the label of a counter.
    """

    reason: str
    n_samples: int

    @property
    def is_estimated(self) -> bool:
        """Whether the number of samples is derived from time, not from a counter."""
        return self.reason == UNCOUNTED_LOSS


class StampFault(StrEnum):
    """Fault of a device's time stamp; the names are used as labels of counters."""

    REGRESSED = "stamp_regressed"
    REPEATED = "stamp_repeated"
    JUMPED = "stamp_jumped"


@dataclass(frozen=True)
class DeviceClock:
    """Time stamp and sampling clock of a device, compared with the host's clock.

    Parameters
    ----------
    offset_s
        Offset of the device's time stamps from the host's clock at the smallest observed delay,
        positive if ahead; None if the device has no time stamps.
    drift_ppm
        Deviation of the sampling rate from nominal by the host's clock, in parts per million; None
        until enough blocks have arrived, and for devices that sample when polled.
    u_drift_ppm
        Standard uncertainty of `drift_ppm`; None if `drift_ppm` is None.
    n_faults
        Number of blocks with an unused time stamp since the adapter started.
    """

    offset_s: float | None
    drift_ppm: float | None
    u_drift_ppm: float | None
    n_faults: int = 0


class BlockMisfitError(ValueError):
    """Error raised if the unit, rate or number of channels of a block is not the expected one."""


@dataclass(frozen=True, eq=False)
class SideValues:
    """Time stamps, channel states and slow values of a block, one set for each cell.

    A cell is a run of samples with one OK state per channel, one time stamp and one set of slow
    values.

    Parameters
    ----------
    starts : (n_cells,)
        First sample of each cell, relative to the block; ascending from 0.
    start_ns : (n_cells,)
        Time of the first sample of each cell, UTC nanoseconds since 1970.
    ok : (n_channels, n_cells)
        OK state of each channel, as reported by the device.
    slow : (n_slow, n_cells)
        Values of the slow channels; NaN if the device has none.
    """

    starts: IntArray
    start_ns: IntArray
    ok: BoolArray
    slow: FloatArray

    @classmethod
    def of(cls, start_ns: int, ok: Sequence[bool], slow: Sequence[float]) -> "SideValues":
        """Return the time stamp, OK states and slow values that are valid for a whole block."""
        return cls(
            starts=np.zeros(1, dtype=np.int64),
            start_ns=np.array([start_ns], dtype=np.int64),
            ok=np.array(ok, dtype=np.bool_)[:, np.newaxis],
            slow=np.array(slow, dtype=np.float64)[:, np.newaxis],
        )

    @property
    def n_cells(self) -> int:
        """Number of cells (runs of samples with one time stamp) of the block."""
        return len(self.starts)

    def within(self, start: int, stop: int, rate_hz: float) -> "SideValues":
        """Return time stamps, states and slow values of the samples `start` to `stop - 1`."""
        first = int(np.searchsorted(self.starts, start, side="right")) - 1
        cells = slice(first, max(first + 1, int(np.searchsorted(self.starts, stop))))
        starts, start_ns = self.starts[cells] - start, self.start_ns[cells].copy()
        start_ns[0] += ns_from_s(-int(starts[0]) / rate_hz)
        starts[0] = 0
        return SideValues(starts, start_ns, self.ok[:, cells], self.slow[:, cells])


@dataclass(frozen=True, eq=False)
class SampleBlock:
    """Consecutive samples of all waveform channels of one unit, as delivered by its device.

    Parameters
    ----------
    calibration
        Unit, rate, and calibration of counts to engineering units; shared by all blocks of a
        source.
    epoch
        Epoch of the sample count; changes when the device restarts it.
    first_index
        Index of the first sample in this epoch; never wraps.
    counts
        (n_channels, n_samples) int16 counts of the converter, or float32 engineering units from a
        device without counts, NaN for missing samples.
    side
        Time stamps, channel states reported by the device, and slow values.
    rejected
        Samples rejected between the previous block and this one. If `first_index` jumps by more
        than their number, the rest is a gap.
    clock
        Comparison of the device's clock with the host's; None without a device clock.
    stamp_fault
        Fault of a device time stamp that was not used; the time is then derived from the index.
    sampled_s
        Monotonic time of the last sample on the host that read it, s; None if the block comes from
        no device. The age of data is measured from here and so includes delays in the device, the
        link and queues.
    elsewhere
        Readings of slow channels that are measured by other devices, by id.

    Raises
    ------
    ValueError
        If the numbers of channels, slow channels or cells do not match.
    """

    calibration: UnitCalibration
    epoch: int
    first_index: int
    counts: RawArray
    side: SideValues
    rejected: tuple[Rejection, ...] = ()
    clock: DeviceClock | None = None
    stamp_fault: StampFault | None = None
    sampled_s: float | None = None
    elsewhere: Mapping[str, Reading] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n_channels, n_slow = len(self.calibration.channels), len(self.calibration.slow)
        side, n_cells = self.side, self.side.n_cells
        expected = (n_channels, n_channels, n_cells, n_slow, n_cells)
        if self.counts.ndim != 2 or expected != (
            len(self.counts),
            *side.ok.shape,
            *side.slow.shape,
        ):
            raise ValueError(
                f"samples {self.counts.shape}, OK states {side.ok.shape} and slow values"
                f" {side.slow.shape} do not fit {n_channels} channels, {n_slow} slow channels"
                f" and {n_cells} cells"
            )

    def __eq__(self, other: object) -> bool:
        """Whether both blocks are equal bit by bit."""
        if not isinstance(other, SampleBlock):
            return NotImplemented
        return self._content == other._content

    @property
    def _content(self) -> tuple[object, ...]:
        arrays = (self.counts, *(getattr(self.side, each.name) for each in fields(self.side)))
        rest = [getattr(self, f.name) for f in fields(self) if f.name not in ("counts", "side")]
        return (*rest, *((a.dtype, a.shape, a.tobytes()) for a in arrays))

    @property
    def unit(self) -> str:
        """Identifier of the generating unit."""
        return self.calibration.unit

    @property
    def rate_hz(self) -> float:
        """Sampling rate of each channel in Hz."""
        return self.calibration.rate_hz

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.counts.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples

    @property
    def start_ns(self) -> int:
        """Time of the first sample, UTC nanoseconds since 1970."""
        return int(self.side.start_ns[0])

    @property
    def stop_ns(self) -> int:
        """Time of the first sample after the block, UTC nanoseconds since 1970."""
        n_last = self.n_samples - int(self.side.starts[-1])
        return int(self.side.start_ns[-1]) + ns_from_s(n_last / self.rate_hz)

    @cached_property
    def verdicts(self) -> VerdictArray:
        """Quality of each channel in each cell as indices of `VERDICTS`, (n_channels, n_cells)."""
        if not self.n_samples:
            return np.zeros(self.side.ok.shape, dtype=np.uint8)
        limits = self.calibration.limits
        return channel_verdicts(self.counts, self.side.starts, self.side.ok, limits)

    @cached_property
    def channel_quality(self) -> tuple[Quality, ...]:
        """Worst quality of each channel within the block, in the order of the channels."""
        return worst_qualities(self.verdicts)

    def cell_qualities(self) -> Iterator[tuple[tuple[Quality, ...], int]]:
        """Yield channel qualities and end time, UTC ns, of each cell (run with one time stamp)."""
        lengths = np.diff(self.side.starts, append=self.n_samples)
        stops_ns = self.side.start_ns + np.rint(lengths / self.rate_hz * NS_PER_S).astype(np.int64)
        for verdicts, stop_ns in zip(self.verdicts.T.tolist(), stops_ns.tolist(), strict=True):
            yield tuple(VERDICTS[verdict] for verdict in verdicts), stop_ns

    @cached_property
    def samples(self) -> SampleArray:
        """Samples in the engineering unit of each channel, (n_channels, n_samples).

        If a sample of a channel is not finite, all samples of its cell are set to zero and bad: one
        NaN would invalidate a whole spectrum.
        """
        found = self.calibration.to_units(self.counts)
        is_blank = self.verdicts == NOT_FINITE
        if found is not self.counts or not is_blank.any():
            return found
        lengths = np.diff(self.side.starts, append=self.n_samples)
        return np.where(np.repeat(is_blank, lengths, axis=1), np.float32(0.0), found)

    @cached_property
    def slow(self) -> Mapping[str, Reading]:
        """Newest reading of each slow channel, by id."""
        newest = zip(self.calibration.slow, self.side.slow[:, -1].tolist(), strict=True)
        return {c.id: c.reading(value) for c, value in newest} | dict(self.elsewhere)

    def cells(self) -> Iterator["SampleBlock"]:
        """Yield each run of samples with one time stamp (cell) as a separate block."""
        for start, stop in itertools.pairwise([*self.side.starts.tolist(), self.n_samples]):
            yield self.from_sample(start, stop)

    def from_sample(self, start: int, stop: int | None = None) -> "SampleBlock":
        """Return the samples `start` to `stop - 1`, or to the end by default, as a block.

        `rejected` is kept if `start` is 0. Raises `ValueError` if `start` lies outside the block.
        """
        stop = self.n_samples if stop is None else min(stop, self.n_samples)
        if not 0 <= start <= self.n_samples:
            raise ValueError(f"start {start} must be from 0 to {self.n_samples}, the block's end")
        if (start, stop) == (0, self.n_samples):
            return self
        return replace(
            self,
            first_index=self.first_index + start,
            counts=self.counts[:, start:stop],
            side=self.side.within(start, stop, self.rate_hz),
            rejected=() if start else self.rejected,
        )


def joined(blocks: Sequence[SampleBlock]) -> SampleBlock:
    """Return consecutive blocks, at least one, as one block.

    The clock is taken from the last block, `rejected` from the first block, and `stamp_fault` is
    the first fault of any block.
    """
    first, last = blocks[0], blocks[-1]
    if first is last:
        return first
    sides = [block.side for block in blocks]
    return replace(
        last,
        first_index=first.first_index,
        counts=np.concatenate([block.counts for block in blocks], axis=1),
        side=SideValues(
            np.concatenate([b.side.starts + (b.first_index - first.first_index) for b in blocks]),
            np.concatenate([side.start_ns for side in sides]),
            np.concatenate([side.ok for side in sides], axis=1),
            np.concatenate([side.slow for side in sides], axis=1),
        ),
        rejected=first.rejected,
        stamp_fault=next((b.stamp_fault for b in blocks if b.stamp_fault), None),
    )
