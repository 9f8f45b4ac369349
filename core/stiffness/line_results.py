"""What one order line says of a bearing: amplitudes, equation (5) and transfer, with evidence."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.checks.sensor_checks import axes_quality, backward_share
from core.machine.unit import Bearing
from core.quality import Quality, Reading, Reason, missing, worst
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y, CrossSpectrum
from core.spectra.segments import ORDER1, VORTEX
from core.spectra.spectral_statistics import independent_segments
from core.spectra.vortex import roundness, vortex_frequency_hz
from core.stiffness.channel_budget import (
    amplitude_budget,
    amplitude_lines,
    coherence_budget,
    phase_budget,
    phase_lines,
    roundness_budget,
)
from core.stiffness.evidence import EvidenceSettings, LineLimits, chance_coherence, line_excitation
from core.stiffness.ratio import effective_stiffness_n_per_m
from core.stiffness.stiffness_budget import ratio_budget, transfer_budgets
from core.stiffness.transfer import line_transfer
from core.uncertainty import Budget, reading_of, stated, with_budgets

FLOOR_REACH = 12
"""Bins to each side of a line in which its surroundings are judged."""

MAIN_LOBE = 2
"""Bins to each side of a tone that a Hann taper spreads it over."""

DIRECTIONS = {"xx": (SHAFT_X, BEARING_X), "yy": (SHAFT_Y, BEARING_Y)}

AMPLITUDES = {
    "shaft_x": SHAFT_X,
    "shaft_y": SHAFT_Y,
    "bearing_x": BEARING_X,
    "bearing_y": BEARING_Y,
}


@dataclass(frozen=True)
class OrderLine:
    """An order line of one bearing.

    Parameters
    ----------
    orders
        Cross-spectrum at the exact order frequencies.
    bins
        Cross-spectrum at the bins, for the surroundings of the line.
    line
        Which of the order lines.
    quality
        Of what is read from some channels at an order line; without a number, why.
    phasors_um_pk, usable : (n_segments, 4)
        Of the line in each segment, and whether the channel counts there.
    floors_um_pk
        Of (u_x, u_y, v_x, v_y): what a line of each transducer's own noise looks like.
    round_shafts
        Shaft channels whose runout was taken off at 1×.
    """

    bearing: Bearing
    settings: EvidenceSettings
    orders: CrossSpectrum
    bins: CrossSpectrum
    line: int
    quality: Callable[..., Quality | Reading]
    phasors_um_pk: ComplexArray
    usable: npt.NDArray[np.bool_]
    floors_um_pk: tuple[float, ...]
    round_shafts: frozenset[int] = frozenset()

    def runout_um_pk(self, place: int) -> float:
        """Runout in a channel: it is locked to the shaft, so that the vortex is free of it."""
        is_shaft = place in (SHAFT_X, SHAFT_Y)
        free = not is_shaft or self.line != ORDER1 or place in self.round_shafts
        return 0.0 if free else self.bearing.runout_um_pk

    def amplitudes(self) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        """Amplitude of each channel and its budget, by quantity."""
        return with_budgets(
            {f"{name}_um_pk": self._amplitude(place) for name, place in AMPLITUDES.items()},
            {f"{name}_um_pk": self._amplitude_budget(place) for name, place in AMPLITUDES.items()},
        )

    def axes_quality(self, rotation_sense: int) -> Quality:
        """Whether shaft and bearing whirl with the rotation, where their line stands out."""
        limits = self.settings.sensors
        return worst(
            axes_quality(self._backward_share(x, y), rotation_sense, limits)
            for x, y in ((SHAFT_X, SHAFT_Y), (BEARING_X, BEARING_Y))
            if self.orders.n_segments[x, y] and self._stands_out(x) and self._stands_out(y)
        )

    def _backward_share(self, x: int, y: int) -> float:
        power = self.orders.power[self.line]
        cross = complex(self.orders.matrix[self.line, x, y])
        return backward_share(float(power[x, y]), float(power[y, x]), cross)

    def roundness(self) -> tuple[Reading, Budget | None]:
        """How round the shaft's orbit is at the line, and in which sense."""
        quality = self.quality(SHAFT_X, SHAFT_Y)
        if isinstance(quality, Reading):
            return quality, None
        found = roundness(self.orders, self.line)
        shafts = [SHAFT_X, SHAFT_Y]
        counted = self.phasors_um_pk[self.usable[:, shafts].all(axis=1)][:, shafts]
        runout_um_pk = tuple(self.runout_um_pk(place) for place in shafts)
        return Reading(found, quality), roundness_budget(self.bearing, found, counted, runout_um_pk)

    def stiffness(self) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        """Coherence, equation (5) and transfer in both directions, and their budgets."""
        readings: dict[str, Reading] = {}
        budgets: dict[str, Budget] = {}
        for axes, (shaft, bearing) in DIRECTIONS.items():
            quality = self.quality(shaft, bearing)
            if isinstance(quality, Reading):
                readings |= dict.fromkeys(_names(axes), quality)
            else:
                found = self._direction(axes, shaft, bearing, quality, budgets)
                readings |= dict(zip(_names(axes), found, strict=True))
        return readings, budgets

    def _amplitude(self, place: int) -> Reading:
        quality = self.quality(place)
        if isinstance(quality, Reading):
            return quality
        return Reading(float(self.orders.amplitude_um_pk(place)[self.line]), quality)

    def _amplitude_budget(self, place: int) -> Budget | None:
        amplitude = float(self.orders.amplitude_um_pk(place)[self.line])
        counted = self.phasors_um_pk[self.usable[:, place], place]
        lines = amplitude_lines(self.bearing, place, amplitude, self.runout_um_pk(place))
        return amplitude_budget(amplitude, counted, lines)

    def _direction(
        self, axes: str, shaft: int, bearing: int, quality: Quality, budgets: dict[str, Budget]
    ) -> tuple[Reading, ...]:
        n_segments = int(self.orders.n_segments[shaft, bearing])
        few = n_segments < self.settings.min_segments
        coherence = float(self.orders.coherence(shaft, bearing)[self.line])
        independent = independent_segments(n_segments, self.settings.overlap)
        shown = missing(Reason.FEW_SEGMENTS)
        if not few:
            budget = coherence_budget(coherence, independent)
            shown = stated(Reading(coherence, quality), budget)
            budgets |= {f"coherence_{axes}": budget} if budget else {}
        reason = self._why_silent(shaft, bearing, independent, few)
        if reason is not Reason.OK:
            return (shown, *[missing(reason)] * 3)
        k_eff = self._ratio(axes, shaft, bearing, quality, independent, budgets)
        found = line_transfer(
            self.orders, self.line, shaft, bearing, self.bearing.bracket, independent
        )
        if few or found is None:
            return shown, k_eff, missing(Reason.FEW_SEGMENTS), missing(Reason.FEW_SEGMENTS)
        of_k, of_c = transfer_budgets(
            found, self.bearing.bracket, self.bearing.accuracy, self.runout_um_pk(shaft)
        )
        budgets[f"transfer_k_{axes}_n_per_m"] = of_k
        budgets[f"transfer_c_{axes}_n_s_per_m"] = of_c
        return shown, k_eff, reading_of(of_k, quality), reading_of(of_c, quality)

    def _ratio(
        self,
        axes: str,
        shaft: int,
        bearing: int,
        quality: Quality,
        n_segments: float,
        budgets: dict[str, Budget],
    ) -> Reading:
        ratio = float(self.orders.amplitude_ratio(bearing, shaft)[self.line])
        k_eff = effective_stiffness_n_per_m(ratio, 1.0, self.bearing.bracket_stiffness_n_per_m)
        budget = ratio_budget(
            self.orders,
            self.line,
            shaft,
            bearing,
            self.bearing.bracket,
            self.bearing.accuracy,
            n_segments,
            self.runout_um_pk(shaft),
        )
        if budget is None:
            return Reading(k_eff, quality)
        budgets[f"k_eff_{axes}_n_per_m"] = budget
        return reading_of(budget, quality)

    def _why_silent(self, shaft: int, bearing: int, n_segments: float, few: bool) -> Reason:
        """Why nothing may be read from the line; OK if something may."""
        quiet = Reason.INSUFFICIENT_EXCITATION
        if self.orders.power[self.line, shaft, bearing] <= 0.0:
            return quiet
        if self.orders.amplitude_um_pk(bearing)[self.line] < self.floors_um_pk[bearing]:
            return quiet
        # what is no line must not be read as the vortex's
        if (few or self.line == VORTEX) and not self._stands_out(shaft):
            return quiet
        # few segments are coherent with anything
        least = 0.0 if few else max(self.settings.min_coherence, chance_coherence(n_segments))
        limits = LineLimits(least, self.runout_um_pk(shaft))
        if few and not self._stands_out(bearing):
            return quiet
        reason = line_excitation(self.orders, self.line, shaft, bearing, limits)
        return Reason.OK if few and reason is Reason.FEW_SEGMENTS else reason

    @property
    def is_of_shaft(self) -> bool:
        """Whether the shaft moves at the line, in one direction at least."""
        return self._stands_out(SHAFT_X) or self._stands_out(SHAFT_Y)

    def _stands_out(self, place: int) -> bool:
        """Whether the line stands above its surroundings, less those of the other order line."""
        lines_hz = self.orders.frequency_hz
        floor = floor_power(self.bins, place, float(lines_hz[self.line]), lines_hz)
        peak = self.orders.power[self.line, place, place]
        return bool(peak > self.settings.min_line_to_floor * floor)


def marked_hz(readings: Mapping[str, Reading], line: str) -> float | None:
    """Where to mark a line in a spectrum; None if there is none, or it is not the one meant.

    Parameters
    ----------
    line
        "order1" or "vortex".
    """
    reading = readings[f"{line}_frequency_hz"]
    return None if reading.quality.reason is Reason.OUTSIDE_BAND else reading.value


def floor_power(bins: CrossSpectrum, place: int, line_hz: float, lines_hz: FloatArray) -> float:
    """Median power of a channel around a line, µm².

    Parameters
    ----------
    bins
        Cross-spectrum at evenly spaced frequencies.
    lines_hz
        Lines whose main lobes are left out.
    """
    bin_hz = bins.frequency_hz[1] - bins.frequency_hz[0]
    number = np.arange(bins.frequency_hz.size)
    near = np.abs(number - (round(line_hz / bin_hz) - 1)) <= FLOOR_REACH
    positions = (lines_hz / bin_hz).round() - 1
    in_lobe = (np.abs(number[:, np.newaxis] - positions) <= MAIN_LOBE).any(axis=1)
    return float(np.median(bins.power[near & ~in_lobe, place, place]))


def other_line_hz(
    bins: CrossSpectrum, turn_hz: float, band_hz: tuple[float, float], min_line_to_floor: float
) -> float | None:
    """Frequency of a line below 1×, outside the vortex band, that shaft and bearing share.

    Parameters
    ----------
    bins
        Cross-spectrum at evenly spaced frequencies.
    band_hz
        In which the vortex is looked for.

    Returns
    -------
    None if no such line stands out.
    """
    bin_hz = float(bins.frequency_hz[1] - bins.frequency_hz[0])
    margin_hz = (MAIN_LOBE + 1) * bin_hz
    for low, high in ((margin_hz, band_hz[0]), (band_hz[1], turn_hz - margin_hz)):
        found_hz = vortex_frequency_hz([bins], (low, high)) if low < high else None
        if found_hz is None:
            continue
        peak = round(found_hz / bin_hz) - 1
        lines_hz = np.array([found_hz, turn_hz])
        for place in (SHAFT_X, SHAFT_Y):
            floor = floor_power(bins, place, found_hz, lines_hz)
            if bins.power[peak, place, place] > min_line_to_floor * floor:
                return found_hz
    return None


def _names(axes: str) -> tuple[str, str, str, str]:
    return (
        f"coherence_{axes}",
        f"k_eff_{axes}_n_per_m",
        f"transfer_k_{axes}_n_per_m",
        f"transfer_c_{axes}_n_s_per_m",
    )


PHASES = {f"order1_{name}_phase_deg": place for name, place in AMPLITUDES.items()}
"""1× phases of the catalogue, with the place of their channel."""


@dataclass(frozen=True)
class Vectors:
    """Vectors (n,) of one channel whose mean has a phase.

    Parameters
    ----------
    quality
        Of what is read from them; without a number, why.
    """

    um_pk: ComplexArray
    quality: Quality | Reading
    runout_um_pk: float


def phase_readings(
    channels: Mapping[str, Vectors],
) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
    """Phases, deg, positive where a vector leads, and their budgets, by quantity."""
    readings: dict[str, Reading] = {}
    found: dict[str, Budget | None] = {}
    for name, vectors in channels.items():
        mean = complex(vectors.um_pk.mean()) if vectors.um_pk.size else 0j
        if isinstance(vectors.quality, Reading):
            readings[name] = vectors.quality
        elif mean == 0j:
            readings[name] = missing(Reason.INSUFFICIENT_EXCITATION)
        else:
            phase_deg = math.degrees(cmath.phase(mean)) % 360.0
            readings[name] = Reading(phase_deg, vectors.quality)
            lines = phase_lines(vectors.runout_um_pk, abs(mean))
            found[name] = phase_budget(phase_deg, vectors.um_pk, lines)
    return with_budgets(readings, found)
