"""Readings of a bearing at 1× or at the vortex: amplitudes, phases, equation (5), `transfer`."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.checks.sensor_checks import axes_quality, backward_share
from core.machine.unit import Bearing
from core.quality import GOOD, Quality, Reading, Reason, missing, worst
from core.spectra.cross_spectrum import (
    BEARING_X,
    BEARING_Y,
    SHAFT_X,
    SHAFT_Y,
    CrossSpectrum,
    average,
    independent_segments,
    roundness,
    shared_power,
)
from core.spectra.lines import SegmentSettings, peak_frequency_hz
from core.spectra.segments import ORDER1, VORTEX
from core.stiffness.channel_budget import (
    amplitude_budget,
    amplitude_lines,
    coherence_budget,
    phase_budget,
    roundness_budget,
)
from core.stiffness.evidence import chance_coherence, line_excitation
from core.stiffness.stiffness_budget import (
    COHERENCE,
    SPREAD,
    changed_polls,
    ratio_budget,
    ratio_lines,
    transfer_budgets,
)
from core.uncertainty import Budget, Budgeted, effective_number, random_line

FLOOR_REACH = 12
"""Number of bins to each side of a line from which its noise floor is computed."""

MAIN_LOBE = 2
"""Number of bins to each side of a tone in the main lobe of Hann's taper."""

DIRECTIONS = {"xx": (SHAFT_X, BEARING_X), "yy": (SHAFT_Y, BEARING_Y)}

AMPLITUDES = {
    "shaft_x": SHAFT_X,
    "shaft_y": SHAFT_Y,
    "bearing_x": BEARING_X,
    "bearing_y": BEARING_Y,
}


QualityOf = Callable[..., Quality | Reading]
"""Function of channel indices that returns the worst quality of the line in these channels, or a
missing reading with the reason."""


@dataclass(frozen=True)
class OrderLine:
    """Spectral line of one bearing at 1× or at the vortex, averaged over segments or polls.

    Parameters
    ----------
    orders
        Cross-spectrum that contains the line.
    at
        Index of the line in `orders`.
    line
        `ORDER1` or `VORTEX`.
    bins
        Cross-spectrum at the bins, for the noise floor around the line; None for polls.
    min_segments
        Smallest number of independent segments or polls for `transfer`.
    phasors_um_pk : (n, 4)
        Phasors of the line in each segment or poll.
    usable : (n, 4)
        Whether each phasor is usable.
    has_phase : (n, 4)
        Whether the phase of each phasor is known.
    at_mark_um_pk : (n, 4)
        1× phasors with the phase at the passage of the shaft's mark; NaN if unknown.
    floors_um_pk
        Amplitude that each transducer's own noise gives the line, for (u_x, u_y, v_x, v_y).
    round_shafts
        Indices of the shaft channels whose runout was subtracted at 1×.
    """

    bearing: Bearing
    settings: SegmentSettings
    orders: CrossSpectrum
    at: int
    line: int
    bins: CrossSpectrum | None
    min_segments: int
    phasors_um_pk: ComplexArray
    usable: BoolArray
    has_phase: BoolArray
    at_mark_um_pk: ComplexArray
    floors_um_pk: tuple[float, ...]
    round_shafts: frozenset[int] = frozenset()

    @property
    def frequency_hz(self) -> float:
        """Frequency of the line, mean over the segments."""
        return float(self.orders.frequency_hz[self.at])

    def n_segments(self, first: int, last: int) -> int:
        """Return the number of segments or changed polls with usable channels `first`, `last`."""
        if self.bins is not None:
            return int(self.orders.n_segments[first, last])
        both = self.usable[:, first] & self.usable[:, last]
        return int(changed_polls(*np.abs(self.phasors_um_pk[both][:, [first, last]]).T).sum())

    def readings(self, quality_of: QualityOf) -> dict[str, Budgeted]:
        """Return amplitudes, roundness, coherence and stiffnesses with budgets, by quantity."""
        found = {
            f"{name}_um_pk": self._amplitude(place, quality_of(place))
            for name, place in AMPLITUDES.items()
        }
        found["roundness"] = self._roundness(quality_of(SHAFT_X, SHAFT_Y))
        for axes, (shaft, bearing) in DIRECTIONS.items():
            found |= self._direction(axes, shaft, bearing, quality_of(shaft, bearing))
        return found

    def phases(self, quality_of: QualityOf) -> dict[str, Budgeted]:
        """Return the phases of the mean 1× vectors, 0° to 360°; bad readings without a key-phase.

        A phase is the lead of the reading over the shaft's mark.
        """
        return {
            f"{name}_phase_deg": self._phase(place, quality_of(place))
            for name, place in AMPLITUDES.items()
        }

    def axes_quality(self, rotation_sense: int) -> Quality:
        """Return the quality of the channels' axes: not good if the whirl contradicts the rotation.

        Only motion above the noise floor is checked. `rotation_sense` is +1 if the shaft turns from
        x to y, otherwise -1.
        """
        return worst(
            self._pair_quality(x, y, rotation_sense)
            for x, y in ((SHAFT_X, SHAFT_Y), (BEARING_X, BEARING_Y))
        )

    @property
    def is_of_shaft(self) -> bool:
        """Whether the line exceeds the noise floor in at least one shaft channel."""
        return self._stands_out[SHAFT_X] or self._stands_out[SHAFT_Y]

    @cached_property
    def phases_known(self) -> bool:
        """Whether the phase of all four channels is known in any segment or poll."""
        return bool((self.usable & self.has_phase).all(axis=1).any())

    def _runout_um_pk(self, place: int) -> float:
        """Return the largest runout in the line of a channel, µm 0-pk; zero for the vortex."""
        is_shaft = place in (SHAFT_X, SHAFT_Y)
        free = not is_shaft or self.line != ORDER1 or place in self.round_shafts
        return 0.0 if free else self.bearing.runout_um_pk

    @cached_property
    def _phased(self) -> CrossSpectrum:
        """Cross-spectrum averaged over the segments or polls with known phases."""
        if self.bins is not None:
            return self.orders
        known = self.usable & self.has_phase
        return average(self.orders.frequency_hz, self.phasors_um_pk[:, :, np.newaxis], known)

    def _amplitude(self, place: int, quality: Quality | Reading) -> Budgeted:
        if isinstance(quality, Reading):
            return quality, None
        amplitude = float(self.orders.amplitude_um_pk(place)[self.at])
        counted = self.phasors_um_pk[self.usable[:, place], place]
        lines = amplitude_lines(self.bearing, place, amplitude, self._runout_um_pk(place))
        return Reading(amplitude, quality), amplitude_budget(amplitude, counted, lines)

    def _phase(self, place: int, quality: Quality | Reading) -> Budgeted:
        if isinstance(quality, Reading):
            return quality, None
        is_known = np.isfinite(self.at_mark_um_pk[:, place])
        if not is_known[-1]:
            return missing(Reason.NOT_MEASURED), None
        vectors = self.at_mark_um_pk[self.usable[:, place] & is_known, place]
        mean = complex(vectors.mean()) if vectors.size else 0j
        if mean == 0j:
            return missing(Reason.INSUFFICIENT_EXCITATION), None
        phase_deg = math.degrees(cmath.phase(mean)) % 360.0
        budget = phase_budget(phase_deg, vectors, self._runout_um_pk(place))
        return Reading(phase_deg, quality), budget

    def _roundness(self, quality: Quality | Reading) -> Budgeted:
        if isinstance(quality, Reading):
            return quality, None
        if not self._phased.n_segments[SHAFT_X, SHAFT_Y]:
            return NOT_MEASURED
        found, shafts = roundness(self._phased, self.at), [SHAFT_X, SHAFT_Y]
        known = (self.usable & self.has_phase)[:, shafts].all(axis=1)
        counted = self.phasors_um_pk[known][:, shafts]
        runout_um_pk = tuple(self._runout_um_pk(place) for place in shafts)
        return Reading(found, quality), roundness_budget(self.bearing, found, counted, runout_um_pk)

    def _pair_quality(self, x: int, y: int, rotation_sense: int) -> Quality:
        phased = self._phased
        power, cross = phased.power[self.at], complex(phased.matrix[self.at, x, y])
        if self.bins is not None:
            moves = bool(phased.n_segments[x, y]) and self._stands_out[x] and self._stands_out[y]
        else:
            # runout may look like a circular orbit in either direction
            least_um_pk = max(self.floors_um_pk[x], self.floors_um_pk[y], self._runout_um_pk(x))
            moves = bool(min(power[x, y], power[y, x]) > least_um_pk**2)
        if not moves:
            return GOOD
        share = backward_share(float(power[x, y]), float(power[y, x]), cross)
        return axes_quality(share, rotation_sense, self.settings.sensors)

    def _direction(
        self, axes: str, shaft: int, bearing: int, quality: Quality | Reading
    ) -> dict[str, Budgeted]:
        """Return coherence, equation (5) and `transfer` of one direction, by quantity."""
        coherence: Budgeted
        found: list[Budgeted]
        if isinstance(quality, Reading):
            coherence, found = (quality, None), [(quality, None)] * 3
        else:
            few = self.n_segments(shaft, bearing) < self.min_segments
            n_segments = self._n_independent(shaft, bearing)
            value = self.orders.coherence_at(self.at, shaft, bearing)
            coherence = Reading(value, quality), coherence_budget(value, n_segments)
            if few:
                coherence = missing(Reason.FEW_SEGMENTS), None
            reason = self._exclusion_reason(shaft, bearing, n_segments, few)
            if reason is Reason.OK:
                ratio = self._ratio(shaft, bearing, quality, n_segments)
                found = [ratio, *self._transfer(shaft, bearing, quality, n_segments, few)]
            else:
                found = [(missing(reason), None)] * 3
        k_eff, k, c = found
        return {
            f"coherence_{axes}": NOT_MEASURED if self.bins is None else coherence,
            f"k_eff_{axes}_n_per_m": k_eff,
            f"transfer_k_{axes}_n_per_m": k,
            f"transfer_c_{axes}_n_s_per_m": c,
        }

    def _n_independent(self, shaft: int, bearing: int) -> float:
        """Return the effective number of independent segments or polls of a direction."""
        if self.bins is not None:
            n_common = int(self.orders.n_segments[shaft, bearing])
            return independent_segments(n_common, self.settings.overlap)
        u, v = self._common(shaft, bearing)
        changed = changed_polls(u, v)
        return effective_number(v[changed] / u[changed])

    def _ratio(self, shaft: int, bearing: int, quality: Quality, n_segments: float) -> Budgeted:
        bracket, accuracy = self.bearing.bracket, self.bearing.accuracy
        if self.bins is None:
            budget = self._polled_ratio(shaft, bearing, n_segments)
        else:
            runout_um_pk = self._runout_um_pk(shaft)
            budget = ratio_budget(
                self.orders, self.at, shaft, bearing, bracket, accuracy, n_segments, runout_um_pk
            )
        if budget is not None:
            return Reading(budget.value, quality), budget
        ratio = float(self.orders.amplitude_ratio(bearing, shaft)[self.at])
        return Reading(ratio * bracket.stiffness_n_per_m, quality), None

    def _polled_ratio(self, shaft: int, bearing: int, n_effective: float) -> Budget | None:
        """Return the stiffness by equation (5) over polls; None with fewer than two independent.

        A rack may be polled faster than it measures, or average over several poll periods. The
        scatter of the polls is therefore divided by the root of their effective number.
        """
        if n_effective < 2.0:
            return None
        bracket, (u, v) = self.bearing.bracket, self._common(shaft, bearing)
        shaft_um_pk = float(np.sqrt(np.mean(u**2)))
        value = float(np.sqrt(np.mean(v**2))) / shaft_um_pk * bracket.stiffness_n_per_m
        random = float(np.std(v / u * bracket.stiffness_n_per_m, ddof=1)) / math.sqrt(n_effective)
        # without phases, the coherence is at least the smallest accepted one
        known = self._phased.coherence_at(self.at, shaft, bearing)
        lines = ratio_lines(
            value,
            self.frequency_hz,
            bracket,
            self.bearing.accuracy,
            (self._runout_um_pk(shaft), shaft_um_pk),
            self._across(shaft),
            (COHERENCE, max(self.settings.min_coherence, known)),
        )
        return Budget(value, (random_line(SPREAD, random, n_effective - 1.0), *lines))

    def _transfer(
        self, shaft: int, bearing: int, quality: Quality, n_segments: float, few: bool
    ) -> tuple[Budgeted, Budgeted]:
        phased, runout_um_pk = self._phased, self._runout_um_pk(shaft)
        if not phased.n_segments[shaft, bearing]:
            return NOT_MEASURED, NOT_MEASURED
        bracket, accuracy = self.bearing.bracket, self.bearing.accuracy
        found = transfer_budgets(
            phased, self.at, shaft, bearing, bracket, accuracy, n_segments, runout_um_pk
        )
        if few or found is None:
            return (missing(Reason.FEW_SEGMENTS), None), (missing(Reason.FEW_SEGMENTS), None)
        of_k, of_c = found
        return (Reading(of_k.value, quality), of_k), (Reading(of_c.value, quality), of_c)

    def _exclusion_reason(self, shaft: int, bearing: int, n_segments: float, few: bool) -> Reason:
        """Return the reason why the line gives no stiffness; OK if it gives one."""
        quiet, at = Reason.INSUFFICIENT_EXCITATION, self.at
        if self.orders.power[at, shaft, bearing] <= 0.0:
            return quiet
        if self.orders.amplitude_um_pk(bearing)[at] < self.floors_um_pk[bearing]:
            return quiet
        min_coherence, runout_um_pk = self.settings.min_coherence, self._runout_um_pk(shaft)
        if self.bins is None:
            reason = line_excitation(self.orders, at, shaft, bearing, 0.0, runout_um_pk)
            if reason is Reason.OK:  # known phases may change at random
                at_phases = self._phased, at, shaft, bearing
                reason = line_excitation(*at_phases, min_coherence, runout_um_pk)
            return Reason.OK if reason is Reason.FEW_SEGMENTS else reason
        # noise must not be mistaken for the vortex line
        if (few or self.line == VORTEX) and not self._stands_out[shaft]:
            return quiet
        if few and not self._stands_out[bearing]:
            return quiet
        # few segments are coherent by chance
        least = 0.0 if few else max(min_coherence, chance_coherence(n_segments))
        reason = line_excitation(self.orders, at, shaft, bearing, least, runout_um_pk)
        return Reason.OK if few and reason is Reason.FEW_SEGMENTS else reason

    def _common(self, shaft: int, bearing: int) -> tuple[FloatArray, FloatArray]:
        """Return both amplitudes of the polls with usable channels and shaft motion, each (n,)."""
        amplitudes = np.abs(self.phasors_um_pk)
        both = self.usable[:, shaft] & self.usable[:, bearing] & (amplitudes[:, shaft] > 0.0)
        return amplitudes[both, shaft], amplitudes[both, bearing]

    def _across(self, shaft: int) -> float:
        """Return the ratio of transverse shaft amplitude to that of a channel; 1 if unknown."""
        power = self.orders.power[self.at]
        across = SHAFT_Y if shaft == SHAFT_X else SHAFT_X
        along, beside = float(power[shaft, across]), float(power[across, shaft])
        return (beside / along) ** 0.5 if along > 0.0 else 1.0

    @cached_property
    def _stands_out(self) -> list[bool]:
        """Whether the line of each channel exceeds the noise floor around it; False for polls."""
        if self.bins is None:
            return [False] * len(AMPLITUDES)
        floors = floor_power(self.bins, self.frequency_hz, self.orders.frequency_hz)
        peaks = np.diagonal(self.orders.power[self.at])
        found: list[bool] = (peaks > self.settings.min_line_to_floor * floors).tolist()
        return found


NOT_MEASURED: Budgeted = (missing(Reason.NOT_MEASURED), None)


def marked_hz(readings: Mapping[str, Reading], line: str) -> float | None:
    """Return the frequency in Hz of the line "order1" or "vortex"; None without this line."""
    reading = readings[f"{line}_frequency_hz"]
    return None if reading.quality.reason is Reason.OUTSIDE_BAND else reading.value


def floor_power(bins: CrossSpectrum, line_hz: float, lines_hz: FloatArray) -> FloatArray:
    """Return the median power of bins around the frequency `line_hz`, µm², (n_channels,).

    Parameters
    ----------
    bins
        Cross-spectrum at evenly spaced frequencies.
    lines_hz : (n,)
        Frequencies of lines whose main lobes are excluded.
    """
    bin_hz = bins.frequency_hz[1] - bins.frequency_hz[0]
    at = round(line_hz / bin_hz) - 1
    number = np.arange(max(at - FLOOR_REACH, 0), min(at + FLOOR_REACH + 1, bins.frequency_hz.size))
    positions = (lines_hz / bin_hz).round() - 1
    in_lobe = (np.abs(number[:, np.newaxis] - positions) <= MAIN_LOBE).any(axis=1)
    power = np.diagonal(bins.power[number[~in_lobe]], axis1=1, axis2=2)
    ordered = np.sort(power, axis=0)
    middle: FloatArray = ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]
    return middle / 2.0


def other_line_hz(
    bins: CrossSpectrum, turn_hz: float, band_hz: tuple[float, float], min_line_to_floor: float
) -> float | None:
    """Return the frequency in Hz of a coherent line below 1× (`turn_hz`), outside the vortex band.

    `bins` is the cross-spectrum at evenly spaced frequencies. Return None if no line outside
    `band_hz` has more than `min_line_to_floor` times the power of the noise floor.
    """
    bin_hz = float(bins.frequency_hz[1] - bins.frequency_hz[0])
    margin_hz, shared = (MAIN_LOBE + 1) * bin_hz, shared_power([bins])
    for low, high in ((margin_hz, band_hz[0]), (band_hz[1], turn_hz - margin_hz)):
        found_hz = peak_frequency_hz(shared, bins.frequency_hz, (low, high)) if low < high else None
        if found_hz is None:
            continue
        peak = round(found_hz / bin_hz) - 1
        floors = floor_power(bins, found_hz, np.array([found_hz, turn_hz]))
        stands_out = np.diagonal(bins.power[peak]) > min_line_to_floor * floors
        if stands_out[[SHAFT_X, SHAFT_Y]].any():
            return found_hz
    return None
