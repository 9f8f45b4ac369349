"""Monitor of one unit: computation of its bearings' assessments from its sample blocks."""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from core.machine.unit import Unit, bearings_with_new_references, require_same_machine
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.bearing_readings import UnitEvaluation
from core.monitor.refresh import Refresh
from core.quality import Reading
from core.samples.blocks import BlockMisfitError, SampleBlock
from core.samples.gaps import Gap, Reach, SampleAccount, outage, restart
from core.samples.ring import Ring, Window
from core.spectra.polls import PollTransform
from core.spectra.segments import Segment, SegmentTransform


@dataclass(frozen=True)
class MonitorState:
    """State of a monitor that cannot be recomputed from the samples since `start`.

    Parameters
    ----------
    epoch
        Epoch of the samples; None before the first sample.
    start
        Index of the first sample to replay.
    first_start
        Index of the first sample of this epoch, the start of its first possible segment.
    n_voided
        Number of segments interrupted by gaps or restarts.
    growth
        Last measured thermal growth of the gaps, by bearing id.
    account
        Balance of the samples that the device offered.
    """

    epoch: int | None
    start: int
    first_start: int
    n_voided: int
    growth: Mapping[str, Reading]
    account: SampleAccount


class UnitMonitor:
    """Monitor of one unit, which computes assessments of its bearings from sample blocks.

    Results depend only on the samples and their indices, not on the boundaries of blocks or their
    arrival times. `transform` converts sample windows to segments; by default, it is a
    `SegmentTransform` for waveforms.
    """

    def __init__(
        self,
        unit: Unit,
        settings: AnalysisSettings,
        transform: SegmentTransform | PollTransform | None = None,
    ) -> None:
        self.unit = unit
        self._settings = settings
        self._transform = transform or SegmentTransform(unit, settings)
        self._ring = Ring(2 * self._transform.segment_samples)
        self._gaps: list[Gap] = []
        self._growth: dict[str, Reading] = {}
        self._reach: Reach | None = None
        self._next_start: int | None = None
        self._first_start = 0
        self._n_voided = 0
        self._n_results = 0
        self._starts: deque[int] = deque()
        self._rewound_to = self._n_held = 0

    @property
    def account(self) -> SampleAccount:
        """Balance of the samples that the unit's device offered: stored, lost, rejected."""
        return self._ring.account

    @property
    def state(self) -> MonitorState:
        """State from which a new monitor continues after a replay of the newest samples.

        The samples to replay begin up to two averaging times back: the vortex frequency of an
        averaged segment depends on the segments before it.
        """
        newest = max(self._ring.stop_index - 1, 0)  # to find a gap after it
        start = self._starts[0] if self._starts else min(self._next_start or 0, newest)
        return MonitorState(
            self._ring.epoch,
            start,
            self._first_start,
            self._n_voided,
            dict(self._growth),
            self._ring.account,
        )

    def rewind(self, state: MonitorState) -> None:
        """Prepare a new monitor for a replay of stored samples from index `state.start` on.

        Call it before the first block; after the replay, call `settle` with the same state.
        """
        self._rewound_to = state.start

    def settle(self, state: MonitorState) -> None:
        """Restore a state after the replay from `state.start` on; discard gaps in the replay."""
        self._growth = dict(state.growth)
        self._ring.account = state.account
        self._gaps.clear()
        self._first_start, self._n_voided = state.first_start, state.n_voided

    def replace_description(self, unit: Unit) -> None:
        """Replace the description of the unit; the next assessment uses the new one.

        Only the references, clearances and brackets of the bearings may differ; the averaged
        segments depend on all other fields.

        Raises ValueError if another field differs; the message gives its name and both values.
        """
        require_same_machine(self.unit, unit)
        for bearing in bearings_with_new_references(self.unit, unit):
            self._growth.pop(bearing, None)  # growth is relative to the reference
        self.unit = unit

    def go_on(self, reach: Reach | None, n_held: int = 0) -> None:
        """Set the end of the stored samples (None if there are none) before the first block.

        Samples missing between this end and the first block are recorded as gaps. The first segment
        begins `n_held` samples after the first block, modulo the distance of segments, so that the
        segments of units that start together do not all end together.
        """
        self._reach = reach
        self._n_held = n_held % self._transform.hop_samples

    def drain_gaps(self) -> list[Gap]:
        """Return and clear the gaps found since the last call."""
        gaps, self._gaps = self._gaps, []
        return gaps

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Process the next block; yield the assessments that it completes, bearing by bearing."""
        for refresh in self.refreshes(block):
            yield refresh.assessment()

    def refreshes(self, block: SampleBlock) -> Iterator[Refresh]:
        """Process a block and yield the refreshes that it completes, one bearing at a time.

        `block` is the next block in index order; repeated samples are dropped.

        Yields
        ------
        One refresh, not yet evaluated, for each bearing and each hop that the block completes;
        most blocks complete none. The iterator must be exhausted before the next block.

        Raises
        ------
        BlockMisfitError
            If the block belongs to another unit, or differs in rate or number of channels; the
            message gives both values.
        """
        self.require(block)
        for piece in _pieces(block, self._transform.segment_samples):
            self._write(piece)
            yield from self._complete_segments()

    def require(self, block: SampleBlock) -> None:
        """Check that a block fits the unit; the state is unchanged.

        Raises BlockMisfitError if the unit, rate or number of channels differs; the message gives
        both values.
        """
        if block.unit != self.unit.id:
            raise BlockMisfitError(f"expected a block of unit {self.unit.id!r}, got {block.unit!r}")
        if block.rate_hz != self.unit.rate_hz:
            raise BlockMisfitError(
                f"expected samples at {self.unit.rate_hz} Hz, got {block.rate_hz} Hz"
            )
        n_rows, n_channels = self._transform.n_rows, len(block.counts)
        if n_channels != n_rows:
            raise BlockMisfitError(f"expected a block of {n_rows} channels, got {n_channels}")

    def _write(self, block: SampleBlock) -> None:
        epoch, stop_index = self._ring.epoch, self._ring.stop_index
        self._write_to_ring(block)
        restarted = self._ring.epoch != epoch
        if restarted:
            self._transform.clear()
            self._starts.clear()
            self._first_start = self._ring.contiguous_from
            self._n_results = self._first_start // self._transform.result_samples
        if self._next_start is None:
            self._next_start = max(self._ring.contiguous_from + self._n_held, self._rewound_to)
        elif restarted or self._next_start < self._ring.contiguous_from:
            self._n_voided += self._next_start < stop_index
            self._next_start = self._ring.contiguous_from

    def _write_to_ring(self, block: SampleBlock) -> None:
        epoch, gap = self._ring.epoch, self._ring.write(block)
        if epoch is None:
            self._gaps += outage(self._reach, block) if self._reach else []
        elif epoch != block.epoch:
            lost = restart(self._reach, block) if self._reach else None
            self._gaps += [lost] if lost else []
        if gap is not None:
            self._gaps.append(gap)
        if block.stop_index == self._ring.stop_index:
            self._reach = Reach(block.epoch, block.stop_index, block.stop_ns)

    def _complete_segments(self) -> Iterator[Refresh]:
        start, n_samples = self._next_start or 0, self._transform.segment_samples
        while self._ring.holds(start, start + n_samples):
            window = self._ring.read(start, start + n_samples)
            segment = self._transform.add(window)
            self._note_start(start)
            self._next_start = start = start + self._transform.hop_samples
            n_results = segment.stop_index // self._transform.result_samples
            if n_results != self._n_results:
                self._n_results = n_results
                yield from self._refreshes(segment, window)

    def _refreshes(self, newest: Segment, window: Window) -> Iterator[Refresh]:
        n_wanted, kept = self._transform.n_segments, self._transform.snapshot()
        n_possible = 1 + (newest.first_index - self._first_start) // self._transform.hop_samples
        evaluation = UnitEvaluation(self.unit, self._settings, kept, min(n_wanted, n_possible))
        for bearing in self.unit.bearings:
            refresh = Refresh(
                evaluation=evaluation,
                bearing=bearing,
                newest=window,
                n_voided=self._n_voided,
                last_growth=self._growth.get(bearing.id),
            )
            if refresh.growth is not None:
                self._growth[bearing.id] = refresh.growth
            yield refresh

    def _note_start(self, start: int) -> None:
        self._starts.append(start)
        n_samples = 2 * self._transform.n_segments * self._transform.hop_samples
        while self._starts[0] <= start - n_samples:
            self._starts.popleft()


def _pieces(block: SampleBlock, n_most: int) -> Iterator[SampleBlock]:
    """Yield a block in pieces of at most `n_most` samples; the ring buffer holds twice as many.

    Pieces end with a cell if possible: the time of the rest of a cell is rounded twice.
    """
    starts, start = block.side.starts, 0
    while start < block.n_samples:
        stop = start + n_most
        if stop < block.n_samples:
            cell = int(starts[np.searchsorted(starts, stop, side="right") - 1])
            stop = cell if cell > start else stop
        yield block.from_sample(start, stop)
        start = min(stop, block.n_samples)
