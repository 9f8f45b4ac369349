"""Check of device time stamps, and assembly of sample blocks: the last stage of every adapter."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from acquisition.delivery.arrival import Arrival, ArrivalModel
from core.samples.axis import ClockTolerance
from core.samples.blocks import SampleBlock, SideValues, StampFault, joined
from core.samples.calibration import UnitCalibration
from core.units import NS_PER_S, ns_from_s

MIN_BLOCK_S = 0.25
"""Minimum length of blocks without missing samples or pauses."""

_STAMP_NS = 1000
"""Resolution of time stamps. All protocols can transfer this resolution, and slow values in single
precision, so a recording replayed over any protocol gives equal values."""


class BlockJoiner:
    """Joiner of sample blocks, with cells that start at multiples of the cell length.

    The samples of a cell share one OK state per channel and one set of slow values. The cells do
    not depend on the block lengths of the protocol. A cell is shorter only where samples are
    missing or the device restarted. A channel of a cell is OK if it is OK in all parts; the slow
    values are those at the first sample.

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

    def put(self, blocks: Iterable[SampleBlock]) -> list[SampleBlock]:
        """Add the next blocks of a device; return the completed blocks in order."""
        done: list[SampleBlock] = []
        for block in blocks:
            if self._parts and not _follows(self._parts[-1], block):
                done += self.flush()
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
        """Return the complete cells held so far, as at most one block.

        Call it when the device pauses or its link is lost.
        """
        n_whole = self.n_whole
        if not n_whole:
            return []
        whole = joined(self._parts)
        has_rest = n_whole < whole.n_samples
        self._parts = [replace(whole.from_sample(n_whole), stamp_fault=None)] if has_rest else []
        return [_in_cells(whole.from_sample(0, n_whole), self._cell)]

    def discard(self) -> None:
        """Drop all held samples, because they are not to be believed."""
        self._parts = []

    def flush(self) -> list[SampleBlock]:
        """Return all held samples, including an incomplete cell; for the end of the data."""
        parts, self._parts = self._parts, []
        return [_in_cells(joined(parts), self._cell)] if parts else []


def _follows(before: SampleBlock, block: SampleBlock) -> bool:
    """Return whether a block continues `before` without missing or rejected samples in between."""
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
    if len(starts) != side.n_cells or (starts != side.starts).any():
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


_Stamp = tuple[int, int]
"""Index of a sample, and its time stamp in UTC nanoseconds since 1970."""


class StampCheck:
    """Check of time stamps against the sample index, which is exact.

    A wrong stamp is replaced by extrapolation from the last good stamp, and the fault is
    returned. Two consecutive wrong stamps that agree with each other indicate that the device clock
    was set: they are accepted, unless they leave the years 2000 to 2100.

    The attribute `n_faults` is the number of stamps that were not used.
    """

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._rate_hz = 0.0
        self._good: _Stamp = (0, 0)
        self._doubted: _Stamp | None = None
        self.n_faults = 0

    def check(self, block: SampleBlock) -> SampleBlock:
        """Return a block with corrected stamps, and with the fault of the first wrong stamp if any.

        A wrong stamp is replaced by the time that follows from the sample index.
        """
        side, index = block.side, block.first_index + block.side.starts
        if block.epoch != self._epoch:  # the first stamp of an epoch has nothing to disagree with
            self._epoch, self._rate_hz = block.epoch, block.rate_hz
            self._good, self._doubted = (block.first_index, block.start_ns), None
        if side.n_cells > 16 and self._all_fit(index, side.start_ns):  # arrays pay for many cells
            return block
        stamps = zip(index.tolist(), side.start_ns.tolist(), strict=True)
        found = [self._checked(stamp) for stamp in stamps]
        faults = [fault for _, fault in found if fault]
        if not faults:
            return block
        self.n_faults += len(faults)
        corrected = replace(side, start_ns=np.array([start_ns for start_ns, _ in found]))
        return replace(block, side=corrected, stamp_fault=faults[0])

    def _checked(self, stamp: _Stamp) -> tuple[int, StampFault | None]:
        """Return the corrected time of a stamp, ns, and the fault of the stamp or None."""
        good, doubted = self._good, self._doubted
        fault = self._fault(good, stamp)
        was_set = doubted is not None and self._fault(doubted, stamp) is None
        has_failed = good[1] in _POSSIBLE_NS and stamp[1] not in _POSSIBLE_NS
        if fault is None or (was_set and not has_failed):
            self._good, self._doubted = stamp, None
            return stamp[1], None
        self._doubted = stamp
        return good[1] + self._expected_ns(good, stamp), fault

    def _all_fit(self, index: npt.NDArray[np.int64], times_ns: npt.NDArray[np.int64]) -> bool:
        """Return whether all stamps of a block fit within the tolerance; accept them if so."""
        n_passed = np.diff(index, prepend=self._good[0])
        elapsed_ns = np.diff(times_ns, prepend=self._good[1])
        off_ns = np.abs(elapsed_ns - n_passed * (NS_PER_S / self._rate_hz))
        if (n_passed <= 0).any() or (elapsed_ns <= 0).any() or (off_ns > _TOLERANCE.over(0)).any():
            return False
        self._good, self._doubted = (int(index[-1]), int(times_ns[-1])), None
        return True

    def _expected_ns(self, before: _Stamp, after: _Stamp) -> int:
        return ns_from_s((after[0] - before[0]) / self._rate_hz)

    def _fault(self, before: _Stamp, after: _Stamp) -> StampFault | None:
        expected_ns, elapsed_ns = self._expected_ns(before, after), after[1] - before[1]
        if elapsed_ns == 0 and expected_ns:
            return StampFault.REPEATED
        if elapsed_ns * expected_ns < 0:
            return StampFault.REGRESSED
        if abs(elapsed_ns - expected_ns) > _TOLERANCE.over(expected_ns):
            return StampFault.JUMPED
        return None


class BlockAssembler(BlockJoiner):
    """Joiner of the blocks of a device that checks their time stamps and estimates its clock.

    An adapter uses one assembler across all its connections, because the next connection may
    complete an unfinished block.

    Parameters
    ----------
    stamped
        Whether the time stamps of the blocks are those of the device, not of the host.
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
        self._stamped = stamped
        self._samples_when_asked = samples_when_asked
        super().__init__(calibration.block_samples, min_block_s * calibration.rate_hz)
        self._stamps = StampCheck()
        self._arrivals = ArrivalModel(calibration.rate_hz)
        self._fault: StampFault | None = None

    def note_fault(self, fault: StampFault) -> None:
        """Count a time-stamp fault that the caller found, and report it in the next block."""
        self._stamps.n_faults += 1
        self._fault = fault

    def take(
        self,
        blocks: Sequence[SampleBlock],
        arrived: Arrival | None = None,
        held_s: float = 0.0,
        *,
        has_stamp: bool = True,
    ) -> list[SampleBlock]:
        """Add the next blocks of the device, oldest first; return the completed sample blocks.

        Parameters
        ----------
        arrived
            Arrival time of the last sample; None for a recording, whose device clock is not
            judged.
        held_s
            Time in seconds for which the device had held the last sample before its arrival.
        has_stamp
            Whether these blocks have device stamps, if the device provides stamps.
        """
        checked = [self._stamps.check(block) for block in blocks]
        if arrived is None:
            return self.put(checked)
        for block in checked:
            has_good_stamp = self._stamped and has_stamp and not block.stamp_fault
            stop_ns = block.stop_ns if has_good_stamp else None
            self._arrivals.add(block.epoch, block.stop_index, stop_ns, arrived)
        clock = self._arrivals.device_clock(self._stamps.n_faults)
        if self._samples_when_asked:
            clock = replace(clock, drift_ppm=None, u_drift_ppm=None)
        found: list[SampleBlock] = []
        n_after = sum(block.n_samples for block in blocks)
        for block in checked:
            n_after -= block.n_samples
            sampled_s = arrived.steady_s - held_s - n_after / block.rate_hz
            fault, self._fault = block.stamp_fault or self._fault, None
            found.append(replace(block, sampled_s=sampled_s, stamp_fault=fault, clock=clock))
        return self.put(found)
