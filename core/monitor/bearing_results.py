"""From the segments of a unit to the readings of one bearing."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.checks.sensor_checks import stationarity
from core.condition.probe_axes import Growth
from core.condition.shaft_readings import position_results, slow_channels, slow_results
from core.machine.transducers import line_floor_um_pk
from core.machine.unit import Bearing, Estimator, Unit
from core.monitor.overall_results import overall_results, phase_results
from core.monitor.settings import AnalysisSettings
from core.quality import (
    NOT_TOLD,
    Level,
    Quality,
    Reading,
    Reason,
    bad,
    missing,
    uncertain,
    worst,
)
from core.spectra.cross_spectrum import (
    BEARING_X,
    BEARING_Y,
    SHAFT_X,
    SHAFT_Y,
    CrossSpectrum,
    average,
)
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import ORDER1, VORTEX, Segment
from core.stiffness.agreement import contradicting
from core.stiffness.channel_budget import frequency_budget
from core.stiffness.dynamic import DynamicStiffness
from core.stiffness.estimators import preferred_stiffness
from core.stiffness.film_results import film_results
from core.stiffness.line_results import OrderLine, other_line_hz
from core.stiffness.polarity import signs_checked
from core.uncertainty import Budget, with_budgets


class BearingResults:
    """Evaluates one bearing over some segments; holds nothing between evaluations.

    Parameters
    ----------
    segments
        Oldest first, at least one.
    frequency_hz
        (n_lines,) of the segments' bins.
    n_expected
        How many segments there could have been.
    last_growth
        Thermal growth of the gaps when it was last measured.

    Attributes
    ----------
    readings
        One for each quantity of the catalogue.
    budgets
        Of the stiffness and damping readings that have a number, by quantity.
    estimators
        Where `stiffness` came from, by axes "xx" and "yy".
    """

    def __init__(
        self,
        unit: Unit,
        bearing: Bearing,
        settings: AnalysisSettings,
        segments: Sequence[Segment],
        frequency_hz: FloatArray,
        n_expected: int,
        last_growth: Growth | None = None,
    ) -> None:
        self._last_growth = last_growth
        self._unit, self._bearing, self._settings = unit, bearing, settings
        self._segments = segments
        ids = [channel.id for channel in unit.channels]
        self._rows = [ids.index(id_) for id_ in bearing.channels]
        self._usable = np.array([segment.usable[self._rows] for segment in segments])
        self._whole: npt.NDArray[np.bool_] = np.all(self._usable, axis=1)
        self._bins = np.array([segment.bin_phasors_um_pk[self._rows] for segment in segments])
        self.spectrum = average(frequency_hz, self._bins, self._usable)
        self._order_phasors: ComplexArray = np.array(
            [segment.order_phasors_um_pk[self._rows] for segment in segments]
        )
        self._orders = self._average_orders()
        axes_quality = self._order_line(ORDER1).axes_quality(unit.rotation_sense)
        self._doubts = worst((self._steadiness(), axes_quality))
        self.n_segments = int(self._whole.sum())
        self.coverage = self.n_segments / n_expected
        self.budgets: Mapping[str, Budget] = {}
        self.estimators: Mapping[str, Estimator | None] = {}
        self.readings = self._readings()

    def _average_orders(self) -> CrossSpectrum:
        frequency_hz = np.mean([segment.order_frequency_hz for segment in self._segments], axis=0)
        return average(frequency_hz, self._order_phasors, self._usable)

    def _readings(self) -> dict[str, Reading]:
        order1, budgets1 = self._order("order1", ORDER1)
        vortex, budgets_v = self._order("vortex", VORTEX)
        film, budgets_f, found = self._film()
        position, budgets_p = position_results(
            self._unit, self._bearing, self._segments, self._last_growth
        )
        slow, budgets_s = slow_results(self._segments, slow_channels(self._unit, self._bearing))
        phases, budgets_ph = phase_results(
            self._segments, self._rows, self._line_quality, self._order_line(ORDER1).runout_um_pk
        )
        speed = self._segments[-1].speed
        speeds, budgets_n = with_budgets({"speed_rpm": speed.rpm}, {"speed_rpm": speed.budget})
        number = self._unit.bearings.index(self._bearing)
        overall, budgets_o = overall_results(self._segments, self._rows, self._bearing, number)
        readings = signs_checked(
            {
                **speeds,
                **slow,
                **position,
                **order1,
                **phases,
                **overall,
                **vortex,
                **film,
            }
        )
        budgets = {
            **budgets_n,
            **budgets_s,
            **budgets_p,
            **budgets1,
            **budgets_ph,
            **budgets_o,
            **budgets_v,
            **budgets_f,
        }
        self.budgets = {name: b for name, b in budgets.items() if readings[name].value is not None}
        readings |= self._doubted(readings, found)
        chosen = {
            axes: preferred_stiffness(readings, self._bearing.preference, axes)
            for axes in ("xx", "yy")
        }
        self.estimators = {axes: estimator for axes, (_, estimator) in chosen.items()}
        return readings | {f"stiffness_{a}_n_per_m": reading for a, (reading, _) in chosen.items()}

    def _doubted(
        self, readings: Mapping[str, Reading], found: DynamicStiffness | None
    ) -> dict[str, Reading]:
        """Readings of estimators that do not agree, and those that a delay reaches."""
        names: dict[str, Reason] = {}
        if readings["dynamic_k_xx_n_per_m"].quality.reason is Reason.CHANNEL_DELAY:
            delayed = (name for name in self.budgets if "_transfer_" in name)
            names = dict.fromkeys(delayed, Reason.CHANNEL_DELAY)
        lines = {"order1": ORDER1, "vortex": VORTEX}
        differing = contradicting(self.budgets, found, self._orders, lines)
        names |= dict.fromkeys(differing, Reason.ESTIMATORS_DISAGREE)
        return {
            name: replace(
                readings[name], quality=worst((readings[name].quality, uncertain(reason)))
            )
            for name, reason in names.items()
        }

    def _steadiness(self) -> Quality:
        """Whether speed and load stood still over the averaging window."""
        power = self._unit.power_channel
        speeds = [segment.speed.rpm for segment in self._segments]
        powers = [segment.slow.get(power, NOT_TOLD) for segment in self._segments] if power else []
        return stationarity(
            _numbers(speeds),
            _numbers(powers),
            self._settings.sensors,
            self._unit.rated_power_mw,
        )

    def _order_line(self, line: int) -> OrderLine:
        read = self._line_quality if line == ORDER1 else self._vortex_quality
        return OrderLine(
            self._bearing,
            self._settings,
            self._orders,
            self.spectrum,
            line,
            read,
            self._order_phasors[:, :, line],
            self._usable,
            tuple(
                line_floor_um_pk(self._unit.channels[row], float(self._orders.frequency_hz[line]))
                for row in self._rows
            ),
            frozenset(place for place in (SHAFT_X, SHAFT_Y) if self._is_round(place)),
        )

    def _is_round(self, place: int) -> bool:
        """Whether runout was taken off all that is averaged; one segment with it is too much."""
        channel = self._bearing.channels[place]
        counted = zip(self._segments, self._usable[:, place], strict=True)
        return all(s.runout[channel] is RunoutVerdict.APPLIED for s, usable in counted if usable)

    def _order(self, prefix: str, line: int) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        order = self._order_line(line)
        stiffness, budgets = order.stiffness()
        amplitudes, amplitude_budgets = order.amplitudes()
        frequency, roundness = self._frequency(line), order.roundness()
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

    def _film(
        self,
    ) -> tuple[dict[str, Reading], Mapping[str, Budget], DynamicStiffness | None]:
        """All eight coefficients from the segments in which every channel was usable."""
        quality = self._line_quality(*range(len(self._rows)))
        if isinstance(quality, Reading) or not self.n_segments:
            reason = quality.quality if isinstance(quality, Reading) else quality
            return film_results(
                self._bearing, None, (0.0, 0.0), bad(reason.reason), self._settings.dynamic
            )
        whole = [s for s, counts in zip(self._segments, self._whole, strict=True) if counts]
        turns_hz = [float(segment.order_frequency_hz[ORDER1]) for segment in whole]
        spectrum = average(
            self.spectrum.frequency_hz,
            self._bins[self._whole],
            np.ones((len(whole), len(self._rows)), dtype=np.bool_),
        )
        return film_results(
            self._bearing,
            spectrum,
            (min(turns_hz), max(turns_hz)),
            quality,
            self._settings.dynamic,
            self._n_integrations,
        )

    @property
    def _n_integrations(self) -> tuple[int, int]:
        x, y = (self._unit.channels[self._rows[place]] for place in (BEARING_X, BEARING_Y))
        return x.measurand.n_integrations, y.measurand.n_integrations

    def _frequency(self, line: int) -> tuple[Reading, Budget | None]:
        speed, frequency_hz = self._segments[-1].speed, float(self._orders.frequency_hz[line])
        each_hz = np.array([segment.order_frequency_hz[line] for segment in self._segments])
        if speed.rpm.value is None:
            return speed.rpm, None
        if line == ORDER1:
            budget = frequency_budget(frequency_hz, each_hz, speed)
            return Reading(frequency_hz, speed.rpm.quality), budget
        qualities = [self._vortex_quality(shaft) for shaft in (SHAFT_X, SHAFT_Y)]
        known = [q for q in qualities if isinstance(q, Quality)]
        quality = known[0] if known else qualities[0]
        if quality == missing(Reason.OUTSIDE_BAND):
            return Reading(self._other_line_hz, uncertain(Reason.OUTSIDE_BAND)), None
        if isinstance(quality, Reading):
            return quality, None
        return Reading(frequency_hz, speed.rpm.quality), frequency_budget(
            frequency_hz, each_hz, None
        )

    def _vortex_quality(self, *places: int) -> Quality | Reading:
        """As `_line_quality`, at the vortex: nothing is read where there is none."""
        if not self._unit.has_vortex:
            return missing(Reason.SWITCHED_OFF)
        quality = self._line_quality(*places)
        if isinstance(quality, Reading):
            return quality
        if quality.reason is Reason.FEW_SEGMENTS:
            return missing(Reason.FEW_SEGMENTS)
        return self._no_vortex or quality

    @cached_property
    def _no_vortex(self) -> Reading | None:
        """Why no vortex shows in this bearing; None if one does."""
        if self._segments[-1].has_vortex_peak and self._order_line(VORTEX).is_of_shaft:
            return None
        found = self._other_line_hz
        return missing(Reason.NO_VORTEX if found is None else Reason.OUTSIDE_BAND)

    @cached_property
    def _other_line_hz(self) -> float | None:
        turn_hz = float(self._orders.frequency_hz[ORDER1])
        low, high = self._settings.vortex_band
        return other_line_hz(
            self.spectrum,
            turn_hz,
            (low * turn_hz, high * turn_hz),
            self._settings.min_line_to_floor,
        )

    def _line_quality(self, *places: int) -> Quality | Reading:
        """Quality of what is read off a line of these channels, or the reason why nothing is."""
        newest = self._segments[-1]
        rows = [self._rows[place] for place in places]
        own = [_now(newest, row) for row in rows]
        now = worst([newest.speed.rpm.quality, self._doubts, *own])
        n_segments = int(self._orders.n_segments[places[0], places[-1]])
        if newest.speed.rpm.value is None or now.level is Level.BAD or n_segments == 0:
            return missing(now.reason)
        if n_segments < self._settings.min_segments:
            return worst([uncertain(Reason.FEW_SEGMENTS), now])
        if self.coverage < self._settings.min_coverage:
            return worst([now, uncertain(Reason.LOW_COVERAGE)])
        return now


def _now(newest: Segment, row: int) -> Quality:
    """Quality of a channel now; a few clipped samples leave the segments before."""
    is_grazed = newest.is_grazed(row)
    return uncertain(Reason.CLIPPED) if is_grazed else newest.channel_quality[row]


def _numbers(readings: Sequence[Reading]) -> FloatArray:
    return np.array([np.nan if r.value is None else r.value for r in readings])
