"""The last stage of every adapter: stamps checked, blocks cut and joined on their grid."""

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
"""Length of blocks where no sample is missing and no pause ends them."""

_STAMP_NS = 1000
"""Resolution of a stamp. Every profile can carry it, and slow values in single precision, so that a
recording has the same numbers when it is replayed over any wire."""


@dataclass(frozen=True)
class RawBlock:
    """Consecutive samples as a device delivers them, with one set of values beside them.

    Parameters
    ----------
    counts
        (n_channels, n_samples) int16 counts of the converter; or, from a device that has none,
        float32 engineering units, not a number where the device has no sample.
    start_ns
        Time of the first sample, by the device's stamps or by the host's clock.
    ok
        (n_channels,) the device's own verdict on each channel.
    slow
        One value for each configured slow channel, NaN where the device has none.
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
        """Samples per channel."""
        return int(self.counts.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples


def sample_block(raws: Sequence[RawBlock], calibration: UnitCalibration) -> SampleBlock:
    """Raw blocks that follow each other as one block with a cell for each."""
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
    """The cells of a block as raw blocks, without what another device measures."""
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
    """Joins consecutive blocks into whole cells, which begin at multiples of their length.

    However a wire has cut them, the same samples make the same cells. Only where samples are
    missing, or where the device restarts, is a cell shorter. It is OK where all that it is made of
    is, and has the slow values of its first sample.

    Parameters
    ----------
    cell_samples
        Samples of each channel in a cell.
    min_samples
        Whole cells of fewer samples are held until others follow, or until `release`.
    """

    def __init__(self, cell_samples: int, min_samples: float = 0.0) -> None:
        self._cell, self._min_samples = cell_samples, min_samples
        self._parts: list[SampleBlock] = []

    def put(self, block: SampleBlock) -> list[SampleBlock]:
        """Take what a device delivered; return the blocks that this completes, in order."""
        done = [] if self._continued_by(block) else self.flush()
        self._parts.append(block)
        return done if self.n_whole < self._min_samples else done + self.release()

    @property
    def n_whole(self) -> int:
        """Samples in the whole cells that are held."""
        if not self._parts:
            return 0
        stop_index = self._parts[-1].stop_index
        return max(0, stop_index - stop_index % self._cell - self._parts[0].first_index)

    def release(self) -> list[SampleBlock]:
        """Return the whole cells that are held, when nothing follows on them for a while."""
        n_whole = self.n_whole
        if not n_whole:
            return []
        whole = joined(self._parts)
        has_rest = n_whole < whole.n_samples
        self._parts = [replace(whole.from_sample(n_whole), stamp_fault=None)] if has_rest else []
        return [_in_cells(whole.from_sample(0, n_whole), self._cell)]

    def flush(self) -> list[SampleBlock]:
        """Return the block that is not complete, when nothing follows on it."""
        parts, self._parts = self._parts, []
        return [_in_cells(joined(parts), self._cell)] if parts else []

    def _continued_by(self, block: SampleBlock) -> bool:
        return not self._parts or _follows(self._parts[-1], block)


def _follows(before: SampleBlock, block: SampleBlock) -> bool:
    """Whether a block continues another one, without anything missing or refused in between."""
    return (
        not block.rejected
        and block.epoch == before.epoch
        and block.first_index == before.stop_index
        and block.counts.dtype == before.counts.dtype
    )


def _in_cells(block: SampleBlock, length: int) -> SampleBlock:
    """The same block in cells that begin at multiples of a length, with stamps that wires carry."""
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
"""From 2000 to 2100: a clock that leaves it (1904, 1970, 2106) was not set but has failed."""


class StampCheck:
    """Compares each block's stamp with the sample index, which is exact.

    A stamp that does not fit is replaced by the one that follows from the last good stamp, and the
    block names the fault. Two in a row that agree with each other show that the device's clock
    was set: from then on they are believed, unless they have left the years of 2000 to 2100.

    Attributes
    ----------
    n_faults
        Stamps that were not used.
    """

    def __init__(self) -> None:
        self._good: _Stamp | None = None
        self._doubted: _Stamp | None = None
        self.n_faults = 0

    def check(self, block: SampleBlock) -> tuple[SampleBlock, StampFault | None]:
        """Return the block with stamps that can be used, and what was first wrong with its own."""
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
        """Time of a cell, and what is wrong with its own stamp."""
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
        """Whether all stamps of a block fit beyond doubt; if so, believe them at once."""
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
    """Checks stamps and joins what a device delivers into blocks.

    An adapter keeps one for as long as it lives, across connections: an unfinished block may be
    finished by the next one.

    Parameters
    ----------
    stamped
        Whether ``start_ns`` of the raw blocks comes from the device rather than from the host.
    samples_when_asked
        Whether the device samples when the host polls it: it then has no rate that could drift.
    min_block_s
        Shorter blocks of a device that sends all the time are held until more has come, or until
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
        """Mark the next block: a stamp beside those of its samples was not used."""
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
        """Take the next raw block; return the sample blocks that it completes.

        Parameters
        ----------
        arrived
            When its last sample had arrived; None where nothing arrives, as from a recording: the
            device's clock is then not judged.
        held_s
            For how long the device had had that sample by then.
        has_stamp
            Whether this block has one of the device's stamps, if the device stamps at all.
        """
        return self._joined([self._checked(raw, arrived, held_s, has_stamp)])

    def take_together(
        self, raws: Sequence[RawBlock], arrived: Arrival | None = None, read_for_s: float = 0.0
    ) -> list[SampleBlock]:
        """Take raw blocks that came together: the device has held all but the last for longer.

        Parameters
        ----------
        read_for_s
            Time since the device reported which is the newest of them.
        """
        blocks: list[SampleBlock] = []
        n_after = sum(raw.n_samples for raw in raws)
        for raw in raws:
            n_after -= raw.n_samples
            blocks.append(self._checked(raw, arrived, read_for_s + n_after / raw.rate_hz))
        return self._joined(blocks)

    def take_block(self, block: SampleBlock) -> list[SampleBlock]:
        """Take a recorded block, as `take` does."""
        return self._joined([self._marked(*self._stamps.check(block))])

    @property
    def holds_whole_cells(self) -> bool:
        """Whether `release` would return anything."""
        return self._joiner.n_whole > 0

    def release(self) -> list[SampleBlock]:
        """Return the whole cells that are held, when the device has paused or its link is lost."""
        return self._with_clock(self._joiner.release())

    def flush(self) -> list[SampleBlock]:
        """Return what is left at the end, as of a recording."""
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
        """Blocks that these complete, as long as they follow each other."""
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
