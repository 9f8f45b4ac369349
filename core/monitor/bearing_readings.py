"""Readings of one bearing from the segments or polls of its unit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.checks.sensor_checks import stationarity
from core.condition.shaft_readings import pad_results, slow_channels, slow_result
from core.machine.channel import displacement_factors
from core.machine.unit import Bearing, Estimator, Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.overall_readings import overall_readings
from core.quality import (
    NOT_MEASURED,
    Level,
    Quality,
    Reading,
    Reason,
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
from core.spectra.resolution import Resolution
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import ORDER1, VORTEX, Evidence, KeptSegments
from core.stiffness.agreement import contradicting
from core.stiffness.channel_budget import frequency_budget
from core.stiffness.dynamic import DynamicStiffness, FilmSpectrum, films
from core.stiffness.dynamic_readings import NAMES as DYNAMIC_NAMES
from core.stiffness.dynamic_readings import dynamic_readings
from core.stiffness.estimators import as_ratios, preferred_stiffness, ratio_name, signs_checked
from core.stiffness.order_line import OrderLine, other_line_hz
from core.uncertainty import Budget, Budgeted, Found, with_budgets


class UnitEvaluation:
    """Readings of the bearings of one unit, averaged over the same segments or polls.

    The films of all bearings are fitted together, when the readings of one are first requested.

    Parameters
    ----------
    kept
        Segments or polls to average, at least one.
    n_expected
        Number of segments that could have been averaged, for the coverage.
    """

    def __init__(
        self, unit: Unit, settings: AnalysisSettings, kept: KeptSegments, n_expected: int
    ) -> None:
        self.unit, self.settings, self.kept, self.n_expected = unit, settings, kept, n_expected

    @cached_property
    def bearings(self) -> "dict[str, BearingAverage]":
        """Averages of all bearings, by id."""
        averaged = _AveragedSegments(self.unit, self.settings, self.kept)
        return {each.id: BearingAverage(each, self, averaged) for each in self.unit.bearings}

    @cached_property
    def _films(self) -> dict[str, DynamicStiffness | Reason]:
        """Result of `dynamic` for each bearing with a usable spectrum."""
        spectra = {id_: bearing.film_spectrum() for id_, bearing in self.bearings.items()}
        measured = {id_: found for id_, found in spectra.items() if found is not None}
        return dict(
            zip(measured, films(list(measured.values()), self.settings.dynamic), strict=True)
        )

    def of(
        self, bearing: Bearing, position: Found
    ) -> tuple[dict[str, Reading], dict[str, Budget], dict[str, Estimator | None]]:
        """Return readings and budgets of one bearing by quantity, and the preferred estimators.

        The estimators are those from which `stiffness` was taken, by axes "xx" and "yy"; None
        without a value. `position` is the shaft position in the bearing, from `position_results`.
        """
        found = self._films.get(bearing.id)
        readings, budgets = self.bearings[bearing.id].readings(position, found)
        chosen = {
            axes: preferred_stiffness(readings, bearing.preference, axes) for axes in ("xx", "yy")
        }
        readings |= {f"stiffness_{axes}_n_per_m": reading for axes, (reading, _) in chosen.items()}
        if bearing.bracket_stiffness_n_per_m is None:
            readings = as_ratios(readings)
            budgets = {ratio_name(name) or name: budget for name, budget in budgets.items()}
        return readings, budgets, {axes: estimator for axes, (_, estimator) in chosen.items()}


class _AveragedSegments:
    """Order lines of all channels of a unit in n averaged segments or polls, oldest first.

    Attributes
    ----------
    each_hz, order_hz
        Frequencies of 1× and of the vortex in each segment, (n, 2), and their means, (2,).
    usable, has_phase : (n, 2, n_channels)
        Whether each phasor is usable, and whether its phase is known.
    phasors_um_pk : (n, n_channels, 2)
    at_mark_um_pk : (n, n_channels)
        1× phasors with the phase at the passage of the shaft's mark; NaN if unknown.
    floors_um_pk : (n_channels, 2)
        Amplitudes that noise of the channels gives 1× and vortex.
    slow
        Function that returns the mean of a slow channel, by id, with its budget.
    steadiness
        Quality of the data: uncertain if speed or power varied by more than its limit.
    """

    def __init__(self, unit: Unit, settings: AnalysisSettings, kept: KeptSegments) -> None:
        self.segments = segments = list(kept.segments)
        self.each_hz: FloatArray = np.array([s.order_frequency_hz for s in segments])
        self.order_hz: FloatArray = self.each_hz.mean(axis=0)
        self.usable: BoolArray = np.array([s.order_usable for s in segments])
        self.has_phase: BoolArray = np.array([s.has_phase for s in segments])
        self.phasors_um_pk: ComplexArray = np.array([s.order_phasors_um_pk for s in segments])
        self.at_mark_um_pk: ComplexArray = np.array([s.at_mark_um_pk for s in segments])
        factors = np.abs(displacement_factors(unit.channels, self.order_hz))
        own = factors * np.array([[channel.line_floor] for channel in unit.channels])
        self.floors_um_pk = Resolution(unit).floors(own)
        power = unit.power_channel
        speeds = [s.speed.rpm for s in segments]
        powers = [s.slow.get(power, NOT_MEASURED) for s in segments] if power else []
        self.slow = cache(partial(slow_result, segments))
        self.steadiness = stationarity(
            _numbers(speeds), _numbers(powers), settings.sensors, unit.rated_power_mw
        )


class BearingAverage:
    """Average of one bearing over one set of segments or polls, and readings computed from it.

    Attributes
    ----------
    spectrum
        Cross-spectrum at the bins; None for polls.
    """

    def __init__(
        self, bearing: Bearing, whole: UnitEvaluation, averaged: _AveragedSegments
    ) -> None:
        unit, kept = whole.unit, whole.kept
        self._unit, self._bearing, self._settings = unit, bearing, whole.settings
        self._averaged, self._order_hz = averaged, averaged.order_hz
        self._segments = segments = averaged.segments
        self._min_segments = kept.min_segments
        ids = [channel.id for channel in unit.channels]
        rows = self._rows = [ids.index(id_) for id_ in bearing.channels]
        self._usable = averaged.usable[:, :, rows]  # (n, 2, 4)
        self._whole: BoolArray = np.all(self._usable[:, ORDER1], axis=1)
        self._phasors = averaged.phasors_um_pk[:, rows]
        # copying a slice is faster than copying rows in any order
        adjacent = slice(rows[0], rows[0] + len(rows))
        own = adjacent if rows == [*range(adjacent.start, adjacent.stop)] else rows
        bins = [s.bin_phasors_um_pk[own].T for s in segments if s.bin_phasors_um_pk is not None]
        self.spectrum: CrossSpectrum | None = None
        if kept.frequency_hz is not None:
            # in the memory layout of `average`, which then copies nothing
            self._bins: ComplexArray = np.stack(bins, axis=2).transpose(2, 1, 0)
            self.spectrum = average(kept.frequency_hz, self._bins, self._usable[:, ORDER1])
        self._newest_quality = [
            [segments[-1].line_quality(row, line) for row in rows] for line in (ORDER1, VORTEX)
        ]
        self._n_segments = int(self._whole.sum())
        self._coverage = self._n_segments / whole.n_expected
        self._lines = self._order_lines()
        axes_quality = self._lines[ORDER1].axes_quality(unit.rotation_sense)
        self._doubts = worst((averaged.steadiness, axes_quality))

    @property
    def evidence(self) -> Evidence:
        """Kind of the input: waveforms, vectors with phase, or amplitudes only."""
        if self.spectrum is not None:
            return Evidence.WAVEFORMS
        phased = self._lines[ORDER1].phases_known
        return Evidence.AMPLITUDE_AND_PHASE if phased else Evidence.AMPLITUDE_ONLY

    def readings(self, position: Found, found: DynamicStiffness | Reason | None) -> Found:
        """Return all readings but the preferred stiffness, and their budgets.

        `found` is the result of `dynamic` for `film_spectrum`; None without such a spectrum.
        """
        unit, segments = self._unit, self._segments
        speed = segments[-1].speed
        dynamic, film = self._dynamic(found)
        channels = slow_channels(unit, self._bearing).items()
        slow = with_budgets({name: self._averaged.slow(id_) for name, id_ in channels})
        parts: list[Found] = [
            with_budgets({"speed_rpm": (speed.rpm, speed.budget)}),
            slow,
            pad_results(unit, self._bearing, slow[0]),
            position,
            self._order("order1_", ORDER1),
            with_budgets(self._lines[ORDER1].phases(self._line_quality), "order1_"),
            overall_readings(
                segments, self._rows, self._bearing, unit.bearings.index(self._bearing)
            ),
            self._order("vortex_", VORTEX),
            dynamic,
        ]
        readings: dict[str, Reading] = {}
        budgets: dict[str, Budget] = {}
        for some, of_some in parts:
            readings |= some
            budgets |= of_some
        readings = signs_checked(readings)
        known = {name: b for name, b in budgets.items() if readings[name].value is not None}
        return readings | self._doubted(readings, known, film), known

    def _doubted(
        self,
        readings: Mapping[str, Reading],
        budgets: Mapping[str, Budget],
        film: DynamicStiffness | None,
    ) -> dict[str, Reading]:
        """Return the readings that must be marked uncertain, with that quality, by quantity.

        These are stiffnesses and dampings with disagreeing estimators or a channel delay. `film` is
        None without a result of the estimator `dynamic`.
        """
        names: dict[str, Reason] = {}
        if readings["dynamic_k_xx_n_per_m"].quality.reason is Reason.CHANNEL_DELAY:
            delayed = (name for name in budgets if "_transfer_" in name)
            names = dict.fromkeys(delayed, Reason.CHANNEL_DELAY)
        lines = {"order1": ORDER1, "vortex": VORTEX}
        differing = contradicting(budgets, film, self._lines[ORDER1].orders, lines)
        names |= dict.fromkeys(differing, Reason.ESTIMATORS_DISAGREE)
        return {
            name: replace(
                readings[name], quality=worst((readings[name].quality, uncertain(reason)))
            )
            for name, reason in names.items()
        }

    def _order_lines(self) -> tuple[OrderLine, OrderLine]:
        """Return the spectral lines of 1× and of the vortex.

        Both lines are averaged over the same segments; with polls, each over its own usable polls.
        """
        averaged, rows = self._averaged, self._rows
        has_phase, floors_um_pk = averaged.has_phase[:, :, rows], averaged.floors_um_pk[rows]
        at_mark_um_pk = averaged.at_mark_um_pk[:, rows]
        round_shafts = frozenset(p for p in (SHAFT_X, SHAFT_Y) if self._is_round(p))
        orders = average(self._order_hz, self._phasors, self._usable[:, ORDER1])
        lines = []
        for line in (ORDER1, VORTEX):
            of_line, at = orders, line
            if self.spectrum is None:
                parts = self._phasors[:, :, line : line + 1], self._usable[:, line]
                of_line, at = average(self._order_hz[line : line + 1], *parts), 0
            lines.append(
                OrderLine(
                    bearing=self._bearing,
                    settings=self._settings,
                    orders=of_line,
                    at=at,
                    line=line,
                    bins=self.spectrum,
                    min_segments=self._min_segments,
                    phasors_um_pk=self._phasors[:, :, line],
                    usable=self._usable[:, line],
                    has_phase=has_phase[:, line],
                    at_mark_um_pk=at_mark_um_pk,
                    floors_um_pk=tuple(floors_um_pk[:, line].tolist()),
                    round_shafts=round_shafts,
                )
            )
        return lines[0], lines[1]

    def _is_round(self, place: int) -> bool:
        """Whether runout was subtracted in all averaged segments of a shaft channel."""
        channel = self._bearing.channels[place]
        counted = zip(self._segments, self._usable[:, ORDER1, place], strict=True)
        return all(s.runout[channel] is RunoutVerdict.APPLIED for s, usable in counted if usable)

    def _order(self, prefix: str, line: int) -> Found:
        quality_of = self._line_quality if line == ORDER1 else self._vortex_quality
        found = self._lines[line].readings(quality_of)
        return with_budgets({**found, "frequency_hz": self._frequency(line)}, prefix)

    def film_spectrum(self) -> FilmSpectrum | None:
        """Return the spectrum over the segments in which all channels are usable.

        None for polls, without such segments, or if a channel or the speed is bad.
        """
        quality = self._line_quality(*range(len(self._rows)))
        if self.spectrum is None or isinstance(quality, Reading) or not self._n_segments:
            return None
        turns_hz = self._averaged.each_hz[self._whole, ORDER1].tolist()
        spectrum = self.spectrum
        if not self._whole.all():
            all_usable = np.ones((len(turns_hz), len(self._rows)), dtype=np.bool_)
            spectrum = average(spectrum.frequency_hz, self._bins[self._whole], all_usable)
        turn_hz = (min(turns_hz), max(turns_hz))
        return FilmSpectrum(spectrum, self._bearing.bracket, turn_hz, self._n_integrations)

    def _dynamic(
        self, found: DynamicStiffness | Reason | None
    ) -> tuple[Found, DynamicStiffness | None]:
        """Return readings with budgets, and the fitted film (or None), of `dynamic`."""
        quality = self._line_quality(*range(len(self._rows)))
        if self.spectrum is None:
            reason = Reason.NOT_MEASURED
        elif isinstance(quality, Reading):
            reason = quality.quality.reason
        elif isinstance(found, DynamicStiffness):
            return dynamic_readings(self._bearing, found, quality), found
        else:
            reason = found or quality.reason
        return (dict.fromkeys(DYNAMIC_NAMES, missing(reason)), {}), None

    @property
    def _n_integrations(self) -> tuple[int, int]:
        x, y = (self._unit.channels[self._rows[place]] for place in (BEARING_X, BEARING_Y))
        return x.measurand.n_integrations, y.measurand.n_integrations

    def _frequency(self, line: int) -> Budgeted:
        speed, frequency_hz = self._segments[-1].speed, float(self._order_hz[line])
        each_hz = self._averaged.each_hz[:, line]
        if self.spectrum is None and line == VORTEX and not self._unit.has_vortex:
            return missing(Reason.SWITCHED_OFF), None
        if speed.rpm.value is None:
            return speed.rpm, None
        if line == ORDER1 or self.spectrum is None:
            budget = frequency_budget(frequency_hz, each_hz, speed)
            return Reading(frequency_hz, speed.rpm.quality), budget
        qualities = [self._vortex_quality(shaft) for shaft in (SHAFT_X, SHAFT_Y)]
        known = [q for q in qualities if isinstance(q, Quality)]
        quality = known[0] if known else qualities[0]
        if quality == missing(Reason.OUTSIDE_BAND):
            return Reading(self._other_line_hz, uncertain(Reason.OUTSIDE_BAND)), None
        if isinstance(quality, Reading):
            return quality, None
        budget = frequency_budget(frequency_hz, each_hz, None)
        return Reading(frequency_hz, speed.rpm.quality), budget

    def _vortex_quality(self, *places: int) -> Quality | Reading:
        """Return the vortex line's `_line_quality`, or a missing reading if there is no vortex."""
        if not self._unit.has_vortex:
            return missing(Reason.SWITCHED_OFF)
        quality = self._line_quality(*places, line=VORTEX)
        if isinstance(quality, Reading) or self.spectrum is None:
            return quality
        if quality.reason is Reason.FEW_SEGMENTS:
            return missing(Reason.FEW_SEGMENTS)
        return self._no_vortex or quality

    @cached_property
    def _no_vortex(self) -> Reading | None:
        """Missing reading with the reason why there is no vortex line; None if there is one."""
        if self._segments[-1].has_vortex_peak and self._lines[VORTEX].is_of_shaft:
            return None
        found = self._other_line_hz
        return missing(Reason.NO_VORTEX if found is None else Reason.OUTSIDE_BAND)

    @cached_property
    def _other_line_hz(self) -> float | None:
        turn_hz, (low, high) = float(self._order_hz[ORDER1]), self._settings.vortex_band
        band_hz = (low * turn_hz, high * turn_hz)
        if self.spectrum is None:
            return None
        return other_line_hz(self.spectrum, turn_hz, band_hz, self._settings.min_line_to_floor)

    def _line_quality(self, *places: int, line: int = ORDER1) -> Quality | Reading:
        """Return the quality of a line in the channels, or a missing reading with the reason."""
        speed, few = self._segments[-1].speed.rpm, uncertain(Reason.FEW_SEGMENTS)
        own = [self._newest_quality[line][place] for place in places]
        now = worst([speed.quality, self._doubts, *own])
        n_segments = self._lines[line].n_segments(places[0], places[-1])
        if speed.value is None or now.level is Level.BAD or n_segments == 0:
            return missing(now.reason)
        if n_segments < self._min_segments:
            return worst([now, few] if self.spectrum is None else [few, now])
        if self._coverage < self._settings.min_coverage:
            return worst([now, uncertain(Reason.LOW_COVERAGE)])
        return now


def _numbers(readings: Sequence[Reading]) -> FloatArray:
    return np.array([np.nan if r.value is None else r.value for r in readings])
