"""`UnitMonitor`: sample blocks of one unit in, assessments of its bearings out."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from core.condition.shaft_readings import measured_growth
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import Assessment, AveragingWindow, OrbitTrace
from core.monitor.bearing_results import BearingResults
from core.monitor.monitor_state import MonitorState
from core.monitor.monitored_unit import MonitoredUnit
from core.monitor.overall_results import recent_results
from core.monitor.settings import AnalysisSettings
from core.quality import worst
from core.samples.blocks import SampleBlock
from core.samples.ring import Ring
from core.spectra.segments import Segment, SegmentTransform
from core.stiffness.line_results import AMPLITUDES
from core.units import hz_from_rpm

ORBIT_TURNS = 3

JUDGED = (
    "order1_shaft_x_um_pk",
    "order1_shaft_y_um_pk",
    "order1_bearing_x_um_pk",
    "order1_bearing_y_um_pk",
    "stiffness_xx_n_per_m",
    "stiffness_yy_n_per_m",
)
"""The readings whose worst quality is the quality of the assessment."""


class UnitMonitor(MonitoredUnit):
    """Watches one unit. All state of its analysis is here and nowhere else.

    What comes from the samples depends on them and their indices alone, not on how they were cut
    into blocks or when they arrived. Slow readings count for the samples of the block they came
    with.
    """

    def __init__(self, unit: Unit, settings: AnalysisSettings) -> None:
        super().__init__(unit, Ring(len(unit.channels), 2 * settings.segment_samples))
        self._settings = settings
        self._transform = SegmentTransform(unit, settings)
        self._next_start: int | None = None
        self._first_start = 0
        self._n_voided = 0
        self._starts: deque[int] = deque()
        self._rewound_to = 0

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
        """Be as the one was that `state` is of, after these samples."""
        super().settle(state)
        self._first_start, self._n_voided = state.first_start, state.n_voided

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in and hand over what is learnt by it, one bearing at a time."""
        self.require(block)
        for piece in _pieces(block, self._settings.segment_samples):
            self._write(piece)
            yield from self._complete_segments()

    def _write(self, block: SampleBlock) -> None:
        epoch = self._ring.epoch
        self._write_to_ring(block)
        restarted = self._ring.epoch != epoch
        if restarted:
            self._transform.clear()
            self._starts.clear()
            self._first_start = self._ring.contiguous_from
        if self._next_start is None:
            self._next_start = max(self._ring.contiguous_from, self._rewound_to)
        elif restarted or self._next_start < self._ring.contiguous_from:
            self._n_voided += 1
            self._next_start = self._ring.contiguous_from

    def _complete_segments(self) -> Iterator[Assessment]:
        start = self._next_start or 0
        while self._ring.holds(start, start + self._settings.segment_samples):
            window = self._ring.read(start, start + self._settings.segment_samples)
            segment = self._transform.add(window)
            self._note_start(start)
            self._next_start = start = start + self._settings.hop_samples
            for bearing in self.unit.bearings:
                yield self._assess(bearing, segment)

    def _note_start(self, start: int) -> None:
        self._starts.append(start)
        n_samples = 2 * self._settings.n_segments * self._settings.hop_samples
        while self._starts[0] <= start - n_samples:
            self._starts.popleft()

    def _assess(self, bearing: Bearing, newest: Segment) -> Assessment:
        settings = self._settings
        n_possible = 1 + (newest.first_index - self._first_start) // settings.hop_samples
        segments = list(self._transform.segments)
        results = BearingResults(
            self.unit,
            bearing,
            settings,
            segments,
            self._transform.frequency_hz,
            min(settings.n_segments, n_possible),
            self._growth.get(bearing.id),
        )
        readings = results.readings
        growth = measured_growth(readings)
        if growth is not None:
            self._growth[bearing.id] = growth
        n_samples = newest.stop_index - segments[0].first_index
        return Assessment(
            unit=self.unit.id,
            bearing=bearing.id,
            time_ns=newest.stop_ns,
            window=AveragingWindow(
                epoch=newest.epoch,
                first_index=segments[0].first_index,
                stop_index=newest.stop_index,
                n_segments=results.n_segments,
                n_segments_wanted=settings.n_segments,
                n_voided=self._n_voided,
                coverage=results.coverage,
                duration_s=n_samples / self.unit.rate_hz,
            ),
            speed_source=newest.speed.source,
            quality=worst(r.quality for name, r in readings.items() if name in JUDGED),
            readings=readings,
            budgets=results.budgets,
            estimators=results.estimators,
            spectrum=results.spectrum,
            orbit=self._orbit(bearing, newest),
            runout={
                "shaft_x": newest.runout[bearing.shaft_x],
                "shaft_y": newest.runout[bearing.shaft_y],
            },
            clipped_share=self._clipped_share(bearing, newest),
            recent=recent_results(newest, self._rows(bearing), self.unit.rate_hz),
        )

    def _rows(self, bearing: Bearing) -> list[int]:
        by_id = {c.id: n for n, c in enumerate(self.unit.channels)}
        return [by_id[id_] for id_ in bearing.channels]

    def _clipped_share(self, bearing: Bearing, newest: Segment) -> dict[str, float]:
        rows = self._rows(bearing)
        shares = newest.clipped_share[rows].tolist()
        return dict(zip(AMPLITUDES, shares, strict=True))

    def _orbit(self, bearing: Bearing, newest: Segment) -> OrbitTrace | None:
        ids = [channel.id for channel in self.unit.channels]
        rows = [ids.index(bearing.shaft_x), ids.index(bearing.shaft_y)]
        if newest.speed.rpm.value is None or not newest.usable[rows].all():
            return None
        n_samples = round(ORBIT_TURNS / hz_from_rpm(newest.speed.rpm.value) * self.unit.rate_hz)
        stop = newest.stop_index
        window = self._ring.read(max(stop - n_samples, newest.first_index), stop)
        signs = np.array([[self.unit.channels[row].direction] for row in rows], dtype=np.float32)
        traces = signs * window.samples[rows]
        traces -= traces.mean(axis=1, keepdims=True)
        return OrbitTrace(window.start_ns, window.rate_hz, traces[0], traces[1])


def _pieces(block: SampleBlock, n_most: int) -> Iterator[SampleBlock]:
    """Cut a long block so that the ring never overruns the segment being filled."""
    for start in range(0, block.n_samples, n_most):
        yield block.from_sample(start, start + n_most)
