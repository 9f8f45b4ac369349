"""The last stage of every adapter: stamps checked, blocks on their grid, counts calibrated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.delivery.arrival import Arrival, ArrivalModel
from acquisition.delivery.calibration import RawBlock, UnitCalibration, calibrate
from core.samples.axis import ClockTolerance
from core.samples.blocks import DeviceClock, SampleBlock, StampFault
from core.units import NS_PER_S, ns_from_s

_STAMP_NS = 1000
"""Resolution of a stamp. Every profile can carry it, and slow values in single precision, so that a
recording has the same numbers when it is replayed over any wire."""


class BlockGrid:
    """Cuts and joins raw blocks, so that they begin at multiples of a length and are that long.

    Only where samples are missing, or where the device restarts, is a block shorter. A joined
    block is OK where all its parts are, and has the slow values of its first sample.

    Parameters
    ----------
    block_samples
        Samples of each channel in a block.
    """

    def __init__(self, block_samples: int) -> None:
        self._length = block_samples
        self._parts: list[RawBlock] = []

    def put(self, raw: RawBlock) -> list[RawBlock]:
        """Take what a device delivered; return the blocks that this completes, in order."""
        done = [] if self._continued_by(raw) else self.flush()
        for piece in self._pieces(raw):
            self._parts.append(piece)
            if piece.stop_index % self._length == 0:
                done += self.flush()
        return done

    def flush(self) -> list[RawBlock]:
        """Return the block that is not complete, when nothing follows on it."""
        parts, self._parts = self._parts, []
        return [_joined(parts)] if parts else []

    def _continued_by(self, raw: RawBlock) -> bool:
        if not self._parts:
            return True
        last = self._parts[-1]
        return (
            not raw.rejected
            and raw.epoch == last.epoch
            and raw.first_index == last.stop_index
            and raw.counts.dtype == last.counts.dtype
        )

    def _pieces(self, raw: RawBlock) -> list[RawBlock]:
        first_cut = -raw.first_index % self._length or self._length
        starts = [0, *range(first_cut, raw.n_samples, self._length)]
        return [
            _part(raw, start, stop)
            for start, stop in zip(starts, [*starts[1:], raw.n_samples], strict=True)
        ]


def _part(raw: RawBlock, start: int, stop: int) -> RawBlock:
    start_ns = raw.start_ns + round(start * NS_PER_S / raw.rate_hz)
    return replace(
        raw,
        first_index=raw.first_index + start,
        start_ns=start_ns // _STAMP_NS * _STAMP_NS,
        counts=raw.counts[:, start:stop],
        slow=tuple(np.array(raw.slow, dtype=np.float32).tolist()),
        rejected=() if start else raw.rejected,
    )


def _joined(parts: list[RawBlock]) -> RawBlock:
    if len(parts) == 1:
        return parts[0]
    return replace(
        parts[0],
        counts=np.concatenate([part.counts for part in parts], axis=1),
        ok=tuple(all(oks) for oks in zip(*(part.ok for part in parts), strict=True)),
    )


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
        self._good: RawBlock | None = None
        self._doubted: RawBlock | None = None
        self.n_faults = 0

    def check(self, raw: RawBlock) -> tuple[RawBlock, StampFault | None]:
        """Return the block with a stamp that can be used, and what was wrong with its own."""
        good, doubted = self._good, self._doubted
        if good is None or raw.epoch != good.epoch:
            return self._believe(raw), None
        fault = _fault(good, raw)
        was_set = (
            doubted is not None and _fault(doubted, raw) is None and not _has_failed(good, raw)
        )
        if fault is None or was_set:
            return self._believe(raw), None
        self._doubted = raw
        self.n_faults += 1
        return replace(raw, start_ns=good.start_ns + _expected_ns(good, raw)), fault

    def _believe(self, raw: RawBlock) -> RawBlock:
        self._good, self._doubted = raw, None
        return raw


def _expected_ns(before: RawBlock, after: RawBlock) -> int:
    return ns_from_s((after.first_index - before.first_index) / after.rate_hz)


def _has_failed(before: RawBlock, after: RawBlock) -> bool:
    return before.start_ns in _POSSIBLE_NS and after.start_ns not in _POSSIBLE_NS


def _fault(before: RawBlock, after: RawBlock) -> StampFault | None:
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
    """Checks stamps, brings blocks onto their grid and calibrates them.

    An adapter keeps one for as long as it lives, across connections: an unfinished block may be
    finished by the next one.

    Parameters
    ----------
    stamped
        Whether ``start_ns`` of the raw blocks comes from the device rather than from the host.
    samples_when_asked
        Whether the device samples when the host polls it: it then has no rate that could drift.
    """

    def __init__(
        self,
        calibration: UnitCalibration,
        *,
        stamped: bool = True,
        samples_when_asked: bool = False,
    ) -> None:
        self._calibration = calibration
        self._stamped = stamped
        self._samples_when_asked = samples_when_asked
        self._grid = BlockGrid(calibration.block_samples)
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
        raw, own_fault = self._stamps.check(raw)
        blocks = self._grid.put(raw)
        fault = own_fault or self._fault
        if blocks:
            self._fault = None
        if arrived is None:
            return [self._sample_block(block, fault) for block in blocks]
        self._note_arrival(raw, has_stamp and own_fault is None, arrived)
        clock = self._reading()
        sampled_s = arrived.steady_s - held_s
        return [
            replace(self._sample_block(block, fault), clock=clock, sampled_s=sampled_s)
            for block in blocks
        ]

    def take_together(
        self, raws: Sequence[RawBlock], arrived: Arrival, read_for_s: float = 0.0
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
            blocks += self.take(raw, arrived, read_for_s + n_after / raw.rate_hz)
        return blocks

    def flush(self) -> list[SampleBlock]:
        """Return what is left at the end, as of a recording."""
        return [calibrate(raw, self._calibration) for raw in self._grid.flush()]

    def _reading(self) -> DeviceClock:
        clock = self._arrivals.device_clock(self._stamps.n_faults)
        if self._samples_when_asked:
            return replace(clock, drift_ppm=None, u_drift_ppm=None)
        return clock

    def _note_arrival(self, raw: RawBlock, is_good: bool, arrived: Arrival) -> None:
        stop_ns = raw.start_ns + ns_from_s(raw.n_samples / raw.rate_hz)
        own_stamp = self._stamped and is_good
        self._arrivals.add(raw.epoch, raw.stop_index, stop_ns if own_stamp else None, arrived)

    def _sample_block(self, raw: RawBlock, fault: StampFault | None) -> SampleBlock:
        block = calibrate(raw, self._calibration)
        return block if fault is None else replace(block, stamp_fault=fault)
