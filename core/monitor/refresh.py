"""Evaluation of one bearing over the segments of one averaging window."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.condition.shaft_readings import measures_growth, position_results
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import Assessment, AveragingWindow, OrbitTrace
from core.monitor.bearing_readings import UnitEvaluation
from core.monitor.overall_readings import recent_readings
from core.quality import Reading, worst
from core.samples.ring import Window
from core.spectra.cross_spectrum import NO_SPECTRUM
from core.spectra.resolution import shaft_matrix
from core.spectra.segments import ORDER1, KeptSegments, Segment
from core.stiffness.estimators import reported_name
from core.stiffness.order_line import AMPLITUDES
from core.uncertainty import Found
from core.units import hz_from_rpm, ns_from_s

ORBIT_TURNS = 3

JUDGED = (
    "order1_shaft_x_um_pk",
    "order1_shaft_y_um_pk",
    "order1_bearing_x_um_pk",
    "order1_bearing_y_um_pk",
    "stiffness_xx_n_per_m",
    "stiffness_yy_n_per_m",
)
"""Quantities whose worst quality is the quality of the assessment."""


@dataclass(frozen=True)
class Refresh:
    """Immutable input from which one assessment of a bearing can be computed later.

    Parameters
    ----------
    evaluation
        Readings of all bearings over the same segments or polls.
    newest
        Samples of the newest segment or poll.
    n_voided
        Number of segments interrupted by gaps or restarts since the service started.
    last_growth
        Last measured thermal growth of the gaps; None if it was never measured.
    """

    evaluation: UnitEvaluation
    bearing: Bearing
    newest: Window
    n_voided: int
    last_growth: Reading | None

    @property
    def unit(self) -> Unit:
        """Unit of the bearing."""
        return self.evaluation.unit

    @property
    def kept(self) -> KeptSegments:
        """Averaged segments or polls, at least one."""
        return self.evaluation.kept

    @cached_property
    def averaged(self) -> AveragingWindow:
        """Range of the averaged samples, with the numbers of segments."""
        first, last = self.kept.segments[0], self._segment
        usable = np.array([segment.order_usable[ORDER1] for segment in self.kept.segments])
        n_segments = int(usable[:, self._rows].all(axis=1).sum())
        return AveragingWindow(
            epoch=last.epoch,
            first_index=first.first_index,
            stop_index=last.stop_index,
            n_segments=n_segments,
            n_segments_wanted=self.kept.n_segments,
            n_voided=self.n_voided,
            coverage=n_segments / self.evaluation.n_expected,
            duration_s=(last.stop_index - first.first_index) / self.unit.rate_hz,
        )

    @property
    def growth(self) -> Reading | None:
        """Thermal growth of the gaps in this window; None if it is not measured."""
        growth = self._position[0]["gap_growth_um"] if measures_growth(self.bearing) else None
        return None if growth is None or growth.value is None else growth

    def assessment(self) -> Assessment:
        """Return the assessment of the bearing, computed from this input."""
        newest, rows = self._segment, self._rows
        clipped = newest.clipped_share[rows].tolist()
        averaged = self.evaluation.bearings[self.bearing.id]
        readings, budgets, estimators = self.evaluation.of(self.bearing, self._position)
        return Assessment(
            unit=self.unit.id,
            bearing=self.bearing.id,
            time_ns=newest.stop_ns,
            window=self.averaged,
            speed_source=newest.speed.source,
            quality=worst(readings[reported_name(readings, name)].quality for name in JUDGED),
            readings=readings,
            budgets=budgets,
            estimators=estimators,
            spectrum=averaged.spectrum or NO_SPECTRUM,
            orbit=None if self._is_polled else self._orbit(rows[:2]),
            runout={
                "shaft_x": newest.runout[self.bearing.shaft_x],
                "shaft_y": newest.runout[self.bearing.shaft_y],
            },
            clipped_share={} if self._is_polled else dict(zip(AMPLITUDES, clipped, strict=True)),
            evidence=averaged.evidence,
            recent=recent_readings(
                list(self.kept.segments)[-self.kept.result_samples :], rows, self.unit.rate_hz
            ),
        )

    @property
    def _segment(self) -> Segment:
        return self.kept.segments[-1]

    @property
    def _is_polled(self) -> bool:
        return self.kept.frequency_hz is None

    @cached_property
    def _rows(self) -> list[int]:
        by_id = {c.id: n for n, c in enumerate(self.unit.channels)}
        return [by_id[id_] for id_ in self.bearing.channels]

    @cached_property
    def _position(self) -> Found:
        segments = list(self.kept.segments)
        return position_results(self.unit, self.bearing, segments, self.last_growth)

    def _orbit(self, rows: list[int]) -> OrbitTrace | None:
        newest, window = self._segment, self.newest
        if newest.speed.rpm.value is None or not newest.usable[rows].all():
            return None
        n_samples = round(ORBIT_TURNS / hz_from_rpm(newest.speed.rpm.value) * self.unit.rate_hz)
        start = max(window.n_samples - n_samples, 0)
        signs = np.array([[self.unit.channels[row].direction] for row in rows], dtype=np.float32)
        traces = signs * window.samples[rows, start:]
        traces -= traces.mean(axis=1, keepdims=True)
        if (matrix := shaft_matrix(self.unit, self.bearing)) is not None:
            traces = matrix.astype(np.float32) @ traces
        start_ns = window.start_ns + ns_from_s(start / window.rate_hz)
        return OrbitTrace(start_ns, window.rate_hz, traces[0], traces[1])
