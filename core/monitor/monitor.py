"""`UnitMonitor`: sample blocks of one unit in, assessments of its bearings out."""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from core.condition.probe_axes import Growth
from core.machine.unit import Unit, bearings_with_new_references, require_same_machine
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.refresh import Refresh
from core.samples.blocks import BlockMisfitError, SampleBlock
from core.samples.gaps import Gap, Reach, SampleAccount, outage, restart
from core.samples.ring import Ring, Window
from core.spectra.polls import PollTransform
from core.spectra.segments import Segment, SegmentTransform


@dataclass(frozen=True)
class MonitorState:
    """State of a monitor that cannot be rebuilt from its samples since `start`.

    Parameters
    ----------
    epoch
        In which its samples are counted; None before the first.
    start
        First sample that it has to see once more.
    first_start
        First sample of what it counts as possible in this epoch.
    n_voided
        Segments that gaps have voided.
    growth
        By bearing.
    """

    epoch: int | None
    start: int
    first_start: int
    n_voided: int
    growth: Mapping[str, Growth]
    account: SampleAccount


class UnitMonitor:
    """Watches one unit. All state of its analysis is here and nowhere else.

    What comes from the samples depends on them and their indices alone, not on how they were cut
    into blocks or when they arrived. Slow readings count for the samples of the block they came
    with.

    Parameters
    ----------
    transform
        Makes segments of windows of samples; by default of waveforms.
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
        self._ring = Ring(self._transform.n_rows, 2 * self._transform.segment_samples)
        self._gaps: list[Gap] = []
        self._growth: dict[str, Growth] = {}
        self._reach: Reach | None = None
        self._next_start: int | None = None
        self._first_start = 0
        self._n_voided = 0
        self._n_results = 0
        self._starts: deque[int] = deque()
        self._rewound_to = 0

    @property
    def account(self) -> SampleAccount:
        """Where every sample went that the unit's device offered."""
        return self._ring.account

    @property
    def state(self) -> MonitorState:
        """What must be known beside its newest samples to go on from here elsewhere.

        The samples begin with the segments by which those were read that are averaged now: where a
        vortex is looked for depends on the segments before.
        """
        start = self._starts[0] if self._starts else self._next_start or 0
        return MonitorState(
            self._ring.epoch,
            start,
            self._first_start,
            self._n_voided,
            dict(self._growth),
            self._ring.account,
        )

    def rewind(self, state: MonitorState) -> None:
        """Expect the samples since `state.start` once more, in a monitor that has seen none."""
        self._rewound_to = state.start

    def settle(self, state: MonitorState) -> None:
        """Take over a state, after the samples since `state.start` were shown again."""
        self._growth = dict(state.growth)
        self._ring.account = state.account
        self._gaps.clear()
        self._first_start, self._n_voided = state.first_start, state.n_voided

    def replace_description(self, unit: Unit) -> None:
        """Take a new description of the same unit, from the next assessment on.

        Parameters
        ----------
        unit
            The bearings' references, clearances and brackets may differ; what the results that
            are being averaged were made with may not.

        Raises
        ------
        ValueError
            If it does; the message says where, and gives both.
        """
        require_same_machine(self.unit, unit)
        for bearing in bearings_with_new_references(self.unit, unit):
            self._growth.pop(bearing, None)  # it counts from a reference
        self.unit = unit

    def go_on(self, reach: Reach | None) -> None:
        """Go on after a stop, before the first block: what is missing since then is a gap."""
        self._reach = reach

    def drain_gaps(self) -> list[Gap]:
        """Hand over the gaps found since the last call, to be recorded."""
        gaps, self._gaps = self._gaps, []
        return gaps

    def ingest(self, block: SampleBlock) -> list[Assessment]:
        """Take a block in and return all assessments that it completes; as `steps`."""
        return list(self.steps(block))

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in and hand over the assessments that it completes, as `refreshes`."""
        for refresh in self.refreshes(block):
            yield refresh.assessment()

    def refreshes(self, block: SampleBlock) -> Iterator[Refresh]:
        """Take a block in and hand over what it completes, one bearing at a time.

        Parameters
        ----------
        block
            Must follow its predecessors in index order; what is repeated is dropped.

        Yields
        ------
        One assessment for each bearing and each hop that the block completes, not yet evaluated;
        mostly none. They must all be taken before the next block.

        Raises
        ------
        BlockMisfitError
            If the block is not of this unit, or has another rate or number of channels; the
            message gives both.
        """
        self.require(block)
        for piece in _pieces(block, self._transform.segment_samples):
            self._write(piece)
            yield from self._complete_segments()

    def require(self, block: SampleBlock) -> None:
        """Refuse a block that does not fit the unit, before anything has changed.

        Raises
        ------
        BlockMisfitError
            If it is of another unit, rate or number of channels; the message gives both.
        """
        if block.unit != self.unit.id:
            raise BlockMisfitError(
                f"block of unit {block.unit!r} in the monitor of {self.unit.id!r}"
            )
        if block.rate_hz != self.unit.rate_hz:
            raise BlockMisfitError(
                f"samples at {block.rate_hz} Hz, configured {self.unit.rate_hz} Hz"
            )
        self._ring.require(block)

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
            self._next_start = max(self._ring.contiguous_from, self._rewound_to)
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
        for bearing in self.unit.bearings:
            refresh = Refresh(
                unit=self.unit,
                bearing=bearing,
                settings=self._settings,
                kept=kept,
                newest=window,
                n_expected=min(n_wanted, n_possible),
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
    """Cut a long block so that the ring never overruns the segment being filled."""
    for start in range(0, block.n_samples, n_most):
        yield block.from_sample(start, start + n_most)
