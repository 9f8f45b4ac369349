"""From the polls of a unit to the readings of one bearing."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.checks.sensor_checks import stationarity
from core.condition.probe_axes import Growth
from core.condition.shaft_readings import position_results, slow_channels, slow_results
from core.machine.transducers import line_floor_um_pk
from core.machine.unit import Bearing, Estimator, Unit
from core.monitor.assessment import Evidence
from core.monitor.overall_results import OVERALL_NAMES, SHAFTS
from core.monitor.settings import AnalysisSettings
from core.quality import NOT_TOLD, Level, Quality, Reading, Reason, missing, uncertain, worst
from core.spectra.recent import RecentReadings
from core.spectra.segments import ORDER1, VORTEX
from core.spectra.vector_polls import Poll
from core.spectra.vector_settings import VectorSettings
from core.stiffness.channel_budget import frequency_budget
from core.stiffness.estimators import STIFFNESS_OF, preferred_stiffness
from core.stiffness.film_results import NAMES as DYNAMIC_NAMES
from core.stiffness.polarity import signs_checked
from core.stiffness.vector_budget import n_independent
from core.stiffness.vector_line import VectorLine
from core.uncertainty import Budget, with_budgets

NO_WAVEFORM = missing(Reason.NOT_MEASURED)


class VectorResults:
    """Evaluates one bearing over some polls; holds nothing between evaluations.

    Parameters
    ----------
    polls
        Oldest first, at least one.
    n_expected
        How many there could have been.
    last_growth
        Thermal growth of the gaps when it was last measured.

    Attributes
    ----------
    readings
        One for each quantity of the catalogue.
    budgets
        Of the readings whose uncertainty is known, by quantity.
    estimators
        Where `stiffness` came from, by axes "xx" and "yy".
    recent
        Shaft vibration at 1× of each poll since the result before.
    """

    def __init__(
        self,
        unit: Unit,
        bearing: Bearing,
        settings: AnalysisSettings,
        averaging: VectorSettings,
        polls: Sequence[Poll],
        n_expected: int,
        last_growth: Growth | None = None,
    ) -> None:
        self._unit, self._bearing = unit, bearing
        self._settings, self._averaging, self._polls = settings, averaging, polls
        self._last_growth = last_growth
        ids = [channel.id for channel in unit.channels]
        self._rows = [ids.index(id_) for id_ in bearing.channels]
        self._usable = [
            np.array([poll.usable(line)[self._rows] for poll in polls]) for line in (ORDER1, VORTEX)
        ]
        order1 = self._line(ORDER1)
        self._doubts = worst((self._steadiness(), order1.axes_quality(unit.rotation_sense)))
        self.n_polls = int(self._usable[ORDER1].all(axis=1).sum())
        self.coverage = self.n_polls / n_expected
        phased = order1.phases_known
        self.evidence = Evidence.AMPLITUDE_AND_PHASE if phased else Evidence.AMPLITUDE_ONLY
        self.budgets: Mapping[str, Budget] = {}
        self.estimators: Mapping[str, Estimator | None] = {}
        self.readings = self._readings()
        self.recent = [self._recent(poll) for poll in polls[-averaging.hop_polls :]]

    def _line(self, line: int) -> VectorLine:
        polls = self._polls
        frequency_hz = float(np.mean([poll.order_frequency_hz[line] for poll in polls]))
        has_phase: npt.NDArray[np.bool_] = np.array([poll.has_phase[self._rows] for poll in polls])
        return VectorLine(
            bearing=self._bearing,
            settings=self._settings,
            line=line,
            frequency_hz=frequency_hz,
            phasors_um_pk=np.array([p.phasors_um_pk[self._rows, line] for p in polls]),
            usable=self._usable[line],
            has_phase=has_phase if line == ORDER1 else np.zeros_like(has_phase),
            min_polls=self._averaging.min_polls,
            quality=self._quality,
            floors_um_pk=tuple(
                line_floor_um_pk(self._unit.channels[row], frequency_hz) for row in self._rows
            ),
        )

    def _readings(self) -> dict[str, Reading]:
        order1, budgets1 = self._order("order1", ORDER1)
        vortex, budgets_v = self._order("vortex", VORTEX)
        position, budgets_p = position_results(
            self._unit, self._bearing, [poll.gaps for poll in self._polls], self._last_growth
        )
        slow, budgets_s = slow_results(
            [poll.gaps for poll in self._polls], slow_channels(self._unit, self._bearing)
        )
        phases, budgets_ph = self._line(ORDER1).phases()
        speed = self._polls[-1].speed
        speeds, budgets_n = with_budgets({"speed_rpm": speed.rpm}, {"speed_rpm": speed.budget})
        readings = signs_checked(
            {
                **speeds,
                **slow,
                **position,
                **order1,
                **phases,
                **vortex,
                **dict.fromkeys((*DYNAMIC_NAMES, *OVERALL_NAMES), NO_WAVEFORM),
            }
        )
        budgets = {**budgets_n, **budgets_s, **budgets_p, **budgets1, **budgets_ph, **budgets_v}
        self.budgets = {name: b for name, b in budgets.items() if readings[name].value is not None}
        chosen = {axes: self._preferred(readings, axes) for axes in ("xx", "yy")}
        self.estimators = {axes: estimator for axes, (_, estimator) in chosen.items()}
        return readings | {f"stiffness_{a}_n_per_m": reading for a, (reading, _) in chosen.items()}

    def _recent(self, poll: Poll) -> RecentReadings:
        found = {f"order1_{name}_um_pk": self._amplitude(poll, p) for p, name in SHAFTS.items()}
        return RecentReadings(poll.time_ns, found)

    def _amplitude(self, poll: Poll, place: int) -> Reading:
        row, speed = self._rows[place], poll.speed.rpm
        quality = worst((speed.quality, poll.quality[row][ORDER1]))
        if speed.value is None or not poll.usable(ORDER1)[row]:
            return missing(quality.reason)
        return Reading(float(abs(poll.phasors_um_pk[row, ORDER1])), quality)

    def _preferred(
        self, readings: Mapping[str, Reading], axes: str
    ) -> tuple[Reading, Estimator | None]:
        """By preference, among the estimators that can be had without waveforms at all."""
        possible = [
            estimator
            for estimator in self._bearing.preference
            if readings[STIFFNESS_OF[estimator].format(axes=axes)].quality.reason
            is not Reason.NOT_MEASURED
        ]
        return preferred_stiffness(readings, possible or self._bearing.preference, axes)

    def _order(self, prefix: str, line: int) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        order = self._line(line)
        stiffness, budgets = order.stiffness()
        amplitudes, amplitude_budgets = order.amplitudes()
        frequency, roundness = self._frequency(line, order), order.roundness()
        others, other_budgets = with_budgets(
            {"frequency_hz": frequency[0], "roundness": roundness[0]},
            {"frequency_hz": frequency[1], "roundness": roundness[1]},
        )
        readings = {**amplitudes, **stiffness, **others}
        budgets = {**amplitude_budgets, **budgets, **other_budgets}
        return (
            {f"{prefix}_{name}": reading for name, reading in readings.items()},
            {f"{prefix}_{name}": budget for name, budget in budgets.items()},
        )

    def _frequency(self, line: int, order: VectorLine) -> tuple[Reading, Budget | None]:
        speed = self._polls[-1].speed
        if line == VORTEX and not self._unit.has_vortex:
            return missing(Reason.SWITCHED_OFF), None
        if speed.rpm.value is None:
            return speed.rpm, None
        each_hz = np.array([poll.order_frequency_hz[line] for poll in self._polls])
        budget = frequency_budget(order.frequency_hz, each_hz, speed)
        return Reading(order.frequency_hz, speed.rpm.quality), budget

    def _steadiness(self) -> Quality:
        power = self._unit.power_channel
        speeds = [poll.speed.rpm.value for poll in self._polls]
        powers = [poll.slow.get(power, NOT_TOLD).value for poll in self._polls] if power else []
        return stationarity(
            _numbers(speeds),
            _numbers(powers),
            self._settings.sensors,
            self._unit.rated_power_mw,
        )

    def _quality(self, line: int, *places: int) -> Quality | Reading:
        """Quality of what is read off a line of these channels, or the reason why nothing is."""
        newest = self._polls[-1]
        if line == VORTEX and not self._unit.has_vortex:
            return missing(Reason.SWITCHED_OFF)
        own = [newest.quality[self._rows[place]][line] for place in places]
        now = worst([newest.speed.rpm.quality, self._doubts, *own])
        if newest.speed.rpm.value is None or any(q.level is Level.BAD for q in own):
            return missing(worst([newest.speed.rpm.quality, *own]).reason)
        if self._n_independent(line, places) < self._averaging.min_polls:
            return worst([now, uncertain(Reason.FEW_SEGMENTS)])
        if self.coverage < self._settings.min_coverage:
            return worst([now, uncertain(Reason.LOW_COVERAGE)])
        return now

    def _n_independent(self, line: int, places: Sequence[int]) -> int:
        usable = self._usable[line][:, list(places)].all(axis=1)
        amplitudes = np.abs([poll.phasors_um_pk[self._rows, line] for poll in self._polls])
        first, last = amplitudes[usable, places[0]], amplitudes[usable, places[-1]]
        return n_independent(first, last)


def _numbers(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values])
