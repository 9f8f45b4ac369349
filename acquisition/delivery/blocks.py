"""Check of device time stamps, and assembly of sample blocks: the last stage of every adapter."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from acquisition.delivery.arrival import Arrival, ArrivalModel
from core.arrays import RawArray
from core.samples.axis import ClockTolerance
from core.samples.blocks import (
    DeviceClock,
    Rejection,
    SampleBlock,
    SideValues,
    StampFault,
    joined,
)
from core.samples.calibration import UnitCalibration
from core.units import NS_PER_S, ns_from_s

MIN_BLOCK_S = 0.25
"""Minimum length of blocks without missing samples or pauses."""

_STAMP_NS = 1000
"""Resolution of time stamps. All protocols can transfer this resolution, and slow values in single
precision, so a recording replayed over any protocol gives equal values."""


@dataclass(frozen=True)
class RawBlock:
    """Consecutive samples as delivered by a device, with one value of each slow channel.

    Parameters
    ----------
    counts
        int16 converter counts (n_channels, n_samples), or, from a device without counts, float32
        engineering units, with NaN for missing samples.
    start_ns
        Time of the first sample, by the device stamps or by the host clock.
    ok
        Whether the device reports each channel as OK (n_channels,).
    slow
        Value of each configured slow channel; NaN if missing.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    counts: RawArray
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...] = ()

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.counts.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples


def sample_block(raws: Sequence[RawBlock], calibration: UnitCalibration) -> SampleBlock:
    """Return one sample block of consecutive raw blocks, with one cell per raw block."""
    first = raws[0]
    if len(raws) == 1:
        counts, side = first.counts, SideValues.of(first.start_ns, first.ok, first.slow)
    else:
        counts = np.concatenate([raw.counts for raw in raws], axis=1)
        side = SideValues(
            starts=np.array([raw.first_index - first.first_index for raw in raws]),
            start_ns=np.array([raw.start_ns for raw in raws]),
            ok=np.array([raw.ok for raw in raws]).T,
            slow=np.array([raw.slow for raw in raws], dtype=np.float64).T,
        )
    return SampleBlock(
        calibration=calibration,
        epoch=first.epoch,
        first_index=first.first_index,
        counts=counts,
        side=side,
        rejected=first.rejected,
    )


def cells_of(block: SampleBlock) -> Iterator[RawBlock]:
    """Yield each cell of a sample block as a raw block, without slow values of other devices."""
    side = block.side
    stops = [*side.starts[1:].tolist(), block.n_samples]
    columns = (side.starts.tolist(), stops, side.start_ns.tolist(), side.ok.T.tolist())
    for start, stop, start_ns, ok, slow in zip(*columns, side.slow.T.tolist(), strict=True):
        yield RawBlock(
            epoch=block.epoch,
            first_index=block.first_index + start,
            start_ns=start_ns,
            rate_hz=block.rate_hz,
            counts=block.counts[:, start:stop],
            ok=tuple(ok),
            slow=tuple(slow),
            rejected=() if start else block.rejected,
        )


class BlockJoiner:
    """Joiner of sample blocks, with cells that start at multiples of the cell length.

    The cells do not depend on the block lengths of the protocol. A cell is shorter only where
    samples are missing or the device restarted. A channel of a cell is OK if it is OK in all parts;
    the slow values are those at the first sample.

    Parameters
    ----------
    cell_samples
        Number of samples per channel in a cell.
    min_samples
        Minimum number of samples of a returned block; fewer are held until more samples follow, or
        until `release`.
    """

    def __init__(self, cell_samples: int, min_samples: float = 0.0) -> None:
        self._cell, self._min_samples = cell_samples, min_samples
        self._parts: list[SampleBlock] = []

    def put(self, block: SampleBlock) -> list[SampleBlock]:
        """Add a block of a device; return the completed blocks in order."""
        done = [] if self._continued_by(block) else self.flush()
        self._parts.append(block)
        return done if self.n_whole < self._min_samples else done + self.release()

    @property
    def n_whole(self) -> int:
        """Number of held samples in complete cells."""
        if not self._parts:
            return 0
        stop_index = self._parts[-1].stop_index
        return max(0, stop_index - stop_index % self._cell - self._parts[0].first_index)

    def release(self) -> list[SampleBlock]:
        """Return the complete cells held so far, as at most one block; for a pause in the data."""
        n_whole = self.n_whole
        if not n_whole:
            return []
        whole = joined(self._parts)
        has_rest = n_whole < whole.n_samples
        self._parts = [replace(whole.from_sample(n_whole), stamp_fault=None)] if has_rest else []
        return [_in_cells(whole.from_sample(0, n_whole), self._cell)]

    def flush(self) -> list[SampleBlock]:
        """Return all held samples, including an incomplete cell; for the end of the data."""
        parts, self._parts = self._parts, []
        return [_in_cells(joined(parts), self._cell)] if parts else []

    def _continued_by(self, block: SampleBlock) -> bool:
        return not self._parts or _follows(self._parts[-1], block)


def _follows(before: SampleBlock, block: SampleBlock) -> bool:
    """Whether a block continues `before` without missing or rejected samples in between."""
    return (
        not block.rejected
        and block.epoch == before.epoch
        and block.first_index == before.stop_index
        and block.counts.dtype == before.counts.dtype
    )


def _in_cells(block: SampleBlock, length: int) -> SampleBlock:
    """Return a block with cells at multiples of a length, and stamps rounded to `_STAMP_NS`."""
    side, first_cut = block.side, -block.first_index % length or length
    starts = np.concatenate([[0], np.arange(first_cut, block.n_samples, length)])
    start_ns, ok, slow = side.start_ns, side.ok, side.slow
    if not np.array_equal(starts, side.starts):
        at = np.searchsorted(side.starts, starts, side="right") - 1
        passed_ns = (starts - side.starts[at]) * NS_PER_S / block.rate_hz
        start_ns, slow = start_ns[at] + np.rint(passed_ns).astype(np.int64), slow[:, at]
        edges = np.union1d(side.starts, starts)
        of_edges = ok[:, np.searchsorted(side.starts, edges, side="right") - 1]
        ok = np.logical_and.reduceat(of_edges, np.searchsorted(edges, starts), axis=1)
    start_ns = start_ns // _STAMP_NS * _STAMP_NS
    slow = slow.astype(np.float32).astype(np.float64)
    return replace(block, side=SideValues(starts, start_ns, ok, slow))


_TOLERANCE = ClockTolerance()

_POSSIBLE_NS = range(946_684_800 * NS_PER_S, 4_102_444_800 * NS_PER_S)
"""Plausible device times, 2000 to 2100; a jump out of them (1904, 1970, 2106) is a failure."""


class StampCheck:
    """Check of time stamps against the sample index, which is exact.

    A wrong stamp is replaced by extrapolation from the last good stamp, and the fault is
    returned. Two consecutive wrong stamps that agree with each other indicate that the device clock
    was set: they are accepted, unless they leave the years 2000 to 2100.

    Attributes
    ----------
    n_faults
        Number of stamps that were not used.
    """

    def __init__(self) -> None:
        self._good: _Stamp | None = None
        self._doubted: _Stamp | None = None
        self.n_faults = 0

    def check(self, block: SampleBlock) -> tuple[SampleBlock, StampFault | None]:
        """Return the block with corrected stamps, and the fault of the first wrong one or None."""
        side, index = block.side, block.first_index + block.side.starts
        if side.n_cells > 1 and self._all_fit(block, index):
            return block, None
        stamps = zip(index.tolist(), side.start_ns.tolist(), strict=True)
        found = [self._checked(_Stamp(block.epoch, *stamp, block.rate_hz)) for stamp in stamps]
        faults = [fault for _, fault in found if fault]
        if not faults:
            return block, None
        self.n_faults += len(faults)
        side = replace(side, start_ns=np.array([start_ns for start_ns, _ in found]))
        return replace(block, side=side), faults[0]

    def _checked(self, stamp: "_Stamp") -> tuple[int, StampFault | None]:
        """Return the corrected time of a stamp, ns, and the fault of the stamp or None."""
        good, doubted = self._good, self._doubted
        if good is None or stamp.epoch != good.epoch:
            self._believe(stamp)
            return stamp.start_ns, None
        fault = _fault(good, stamp)
        was_set = (
            doubted is not None and _fault(doubted, stamp) is None and not _has_failed(good, stamp)
        )
        if fault is None or was_set:
            self._believe(stamp)
            return stamp.start_ns, None
        self._doubted = stamp
        return good.start_ns + _expected_ns(good, stamp), fault

    def _all_fit(self, block: SampleBlock, index: npt.NDArray[np.int64]) -> bool:
        """Whether all stamps of a block fit within the tolerance; accept them if so."""
        good, times_ns = self._good, block.side.start_ns
        if good is not None and good.epoch == block.epoch:
            index = np.concatenate([[good.first_index], index])
            times_ns = np.concatenate([[good.start_ns], times_ns])
        n_passed, elapsed_ns = np.diff(index), np.diff(times_ns)
        off_ns = np.abs(elapsed_ns - n_passed * (NS_PER_S / block.rate_hz))
        if (n_passed <= 0).any() or (elapsed_ns <= 0).any() or (off_ns > _TOLERANCE.over(0)).any():
            return False
        self._believe(_Stamp(block.epoch, int(index[-1]), int(times_ns[-1]), block.rate_hz))
        return True

    def _believe(self, stamp: "_Stamp") -> None:
        self._good, self._doubted = stamp, None


class _Stamp(NamedTuple):
    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float


def _expected_ns(before: _Stamp, after: _Stamp) -> int:
    return ns_from_s((after.first_index - before.first_index) / after.rate_hz)


def _has_failed(before: _Stamp, after: _Stamp) -> bool:
    return before.start_ns in _POSSIBLE_NS and after.start_ns not in _POSSIBLE_NS


def _fault(before: _Stamp, after: _Stamp) -> StampFault | None:
    expected_ns = _expected_ns(before, after)
    elapsed_ns = after.start_ns - before.start_ns
    if elapsed_ns == 0 and expected_ns:
        return StampFault.REPEATED
    if elapsed_ns * expected_ns < 0:
        return StampFault.REGRESSED
    if abs(elapsed_ns - expected_ns) > _TOLERANCE.over(expected_ns):
        return StampFault.JUMPED
    return None


class BlockAssembler:
    """Assembler of sample blocks from raw blocks of a device, with checked time stamps.

    An adapter uses one assembler across all its connections, because the next connection may
    complete an unfinished block.

    Parameters
    ----------
    stamped
        Whether ``start_ns`` of the raw blocks is a device stamp, not a host stamp.
    samples_when_asked
        Whether the device samples only when polled, and so has no sampling rate that could drift.
    min_block_s
        Minimum length of blocks; shorter blocks are held until more samples arrive, or until
        `release`.
    """

    def __init__(
        self,
        calibration: UnitCalibration,
        *,
        stamped: bool = True,
        samples_when_asked: bool = False,
        min_block_s: float = 0.0,
    ) -> None:
        self._calibration = calibration
        self._stamped = stamped
        self._samples_when_asked = samples_when_asked
        min_samples = min_block_s * calibration.rate_hz
        self._joiner = BlockJoiner(calibration.block_samples, min_samples)
        self._stamps = StampCheck()
        self._arrivals = ArrivalModel(calibration.rate_hz)
        self._fault: StampFault | None = None

    def note_fault(self, fault: StampFault) -> None:
        """Count the fault of a stamp other than a sample stamp, and report it in the next block."""
        self._stamps.n_faults += 1
        self._fault = fault

    def take(
        self,
        raw: RawBlock,
        arrived: Arrival | None = None,
        held_s: float = 0.0,
        *,
        has_stamp: bool = True,
    ) -> list[SampleBlock]:
        """Add the next raw block; return the completed sample blocks.

        Parameters
        ----------
        arrived
            Arrival time of the last sample; None for a recording, whose device clock is not
            judged.
        held_s
            Time for which the device had held the last sample before its arrival.
        has_stamp
            Whether this block has a device stamp, if the device provides stamps.
        """
        return self._joined([self._checked(raw, arrived, held_s, has_stamp)])

    def take_together(
        self, raws: Sequence[RawBlock], arrived: Arrival | None = None, read_for_s: float = 0.0
    ) -> list[SampleBlock]:
        """Add raw blocks that arrived together, oldest first; return the completed sample blocks.

        Parameters
        ----------
        read_for_s
            Time for which the device had held the newest block before its arrival.
        """
        blocks: list[SampleBlock] = []
        n_after = sum(raw.n_samples for raw in raws)
        for raw in raws:
            n_after -= raw.n_samples
            blocks.append(self._checked(raw, arrived, read_for_s + n_after / raw.rate_hz))
        return self._joined(blocks)

    def take_block(self, block: SampleBlock) -> list[SampleBlock]:
        """Add a recorded block; return the completed sample blocks."""
        return self._joined([self._marked(*self._stamps.check(block))])

    @property
    def holds_whole_cells(self) -> bool:
        """Whether `release` would return a block."""
        return self._joiner.n_whole > 0

    def release(self) -> list[SampleBlock]:
        """Return the complete cells held so far; for a pause of the device or a lost link."""
        return self._with_clock(self._joiner.release())

    def flush(self) -> list[SampleBlock]:
        """Return all held samples, with an incomplete last cell; for the end of a recording."""
        return self._joiner.flush()

    def _checked(
        self, raw: RawBlock, arrived: Arrival | None, held_s: float, has_stamp: bool = True
    ) -> SampleBlock:
        block, fault = self._stamps.check(sample_block([raw], self._calibration))
        if arrived is not None:
            stop_ns = block.stop_ns if self._stamped and has_stamp and not fault else None
            self._arrivals.add(raw.epoch, raw.stop_index, stop_ns, arrived)
            block = replace(block, sampled_s=arrived.steady_s - held_s)
        return self._marked(block, fault)

    def _marked(self, block: SampleBlock, own_fault: StampFault | None) -> SampleBlock:
        fault, self._fault = own_fault or self._fault, None
        return replace(block, stamp_fault=fault) if fault else block

    def _joined(self, blocks: Sequence[SampleBlock]) -> list[SampleBlock]:
        """Return the blocks completed by these blocks; runs of consecutive blocks are joined."""
        cuts = [n for n in range(1, len(blocks)) if not _follows(blocks[n - 1], blocks[n])]
        runs = itertools.pairwise([0, *cuts, len(blocks)])
        done = [b for run in runs if blocks for b in self._joiner.put(joined(blocks[slice(*run)]))]
        return self._with_clock(done)

    def _with_clock(self, done: Sequence[SampleBlock]) -> list[SampleBlock]:
        return [b if b.sampled_s is None else replace(b, clock=self._clock()) for b in done]

    def _clock(self) -> DeviceClock:
        clock = self._arrivals.device_clock(self._stamps.n_faults)
        if self._samples_when_asked:
            return replace(clock, drift_ppm=None, u_drift_ppm=None)
        return clock
