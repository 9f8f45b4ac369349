"""From the segments of a unit to the readings of one bearing."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.cross_spectrum import (
    BEARING_X,
    BEARING_Y,
    SHAFT_X,
    SHAFT_Y,
    CrossSpectrum,
    average,
)
from core.machine import Bearing, Measurand, Unit
from core.quality import (
    Quality,
    Reading,
    Reason,
    mean_reading,
    missing,
    uncertain,
    worst,
)
from core.ratio import effective_stiffness_n_per_m
from core.segments import ORDER1, VORTEX, Segment
from core.settings import AnalysisSettings
from core.shaft_centre import shaft_centre

FLOOR_REACH = 12
"""Bins to each side of a line in which its surroundings are judged."""

MAIN_LOBE = 2
"""Bins to each side of a tone that a Hann taper spreads it over."""


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
    """

    def __init__(
        self,
        unit: Unit,
        bearing: Bearing,
        settings: AnalysisSettings,
        segments: Sequence[Segment],
        frequency_hz: FloatArray,
        n_expected: int,
    ) -> None:
        self._unit, self._bearing, self._settings = unit, bearing, settings
        self._segments = segments
        ids = [channel.id for channel in unit.channels]
        self._rows = [ids.index(id_) for id_ in bearing.channels]
        usable = np.array([segment.usable[self._rows] for segment in segments])
        self.spectrum = self._average(frequency_hz, [s.bin_phasors_um_pk for s in segments], usable)
        self._orders = self._average(
            np.mean([s.order_frequency_hz for s in segments], axis=0),
            [s.order_phasors_um_pk for s in segments],
            usable,
        )
        self.n_segments = int(usable.all(axis=1).sum())
        self.coverage = self.n_segments / n_expected

    def readings(self) -> dict[str, Reading]:
        """One reading for each quantity of the catalogue."""
        newest = self._segments[-1]
        return {
            "speed_rpm": newest.speed.rpm,
            "power_mw": self._slow(self._unit.power_channel),
            "oil_temperature_c": self._slow(self._bearing.oil_temperature),
            **self._position(),
            **self._order("order1", ORDER1),
            **self._order("vortex", VORTEX),
        }

    def _average(
        self,
        frequency_hz: FloatArray,
        phasors: list[npt.NDArray[np.complex128]],
        usable: npt.NDArray[np.bool_],
    ) -> CrossSpectrum:
        return average(frequency_hz, np.array([p[self._rows] for p in phasors]), usable)

    def _slow(self, channel: str | None) -> Reading:
        if channel is None:
            return missing(Reason.NOT_MEASURED)
        return mean_reading([segment.slow[channel] for segment in self._segments])

    def _position(self) -> dict[str, Reading]:
        gap_x, gap_y = (
            self._gap(SHAFT_X, self._bearing.gap_x),
            self._gap(SHAFT_Y, self._bearing.gap_y),
        )
        centre = shaft_centre(
            (gap_x, gap_y), self._bearing.gap_reference_um, self._bearing.clearance_um
        )
        return {
            "gap_x_um": gap_x,
            "gap_y_um": gap_y,
            "shaft_centre_x_um": centre.x_um,
            "shaft_centre_y_um": centre.y_um,
            "eccentricity_ratio": centre.eccentricity_ratio,
            "attitude_angle_deg": centre.attitude_angle_deg,
        }

    def _gap(self, place: int, slow_channel: str | None) -> Reading:
        """Mean gap over the averaging window, from the slow channel or a DC-coupled probe."""
        if slow_channel is not None:
            gap_mm = self._slow(slow_channel)
            return gap_mm if gap_mm.value is None else Reading(1e3 * gap_mm.value, gap_mm.quality)
        row = self._rows[place]
        if self._unit.channels[row].measurand is not Measurand.GAP_UM:
            return missing(Reason.NOT_MEASURED)
        return mean_reading(
            [
                Reading(float(segment.mean[row]), segment.channel_quality[row])
                if segment.usable[row]
                else missing(segment.channel_quality[row].reason)
                for segment in self._segments
            ]
        )

    def _order(self, prefix: str, line: int) -> dict[str, Reading]:
        x = self._direction(line, SHAFT_X, BEARING_X)
        y = self._direction(line, SHAFT_Y, BEARING_Y)
        return {
            f"{prefix}_frequency_hz": self._frequency(line),
            f"{prefix}_shaft_x_um_pk": self._amplitude(line, SHAFT_X),
            f"{prefix}_shaft_y_um_pk": self._amplitude(line, SHAFT_Y),
            f"{prefix}_bearing_x_um_pk": self._amplitude(line, BEARING_X),
            f"{prefix}_bearing_y_um_pk": self._amplitude(line, BEARING_Y),
            f"{prefix}_k_eff_xx_n_per_m": x[0],
            f"{prefix}_k_eff_yy_n_per_m": y[0],
            f"{prefix}_coherence_xx": x[1],
            f"{prefix}_coherence_yy": y[1],
        }

    def _frequency(self, line: int) -> Reading:
        speed = self._segments[-1].speed.rpm
        if speed.value is None:
            return speed
        return Reading(float(self._orders.frequency_hz[line]), speed.quality)

    def _amplitude(self, line: int, place: int) -> Reading:
        quality = self._line_quality(place)
        if isinstance(quality, Reading):
            return quality
        return Reading(float(self._orders.amplitude_um_pk(place)[line]), quality)

    def _line_quality(self, *places: int) -> Quality | Reading:
        """Quality of what is read off a line of these channels, or the reason why nothing is."""
        newest = self._segments[-1]
        rows = [self._rows[place] for place in places]
        now = worst([newest.speed.rpm.quality, *(newest.channel_quality[row] for row in rows)])
        if newest.speed.rpm.value is None or not newest.usable[rows].all():
            return missing(now.reason)
        n_segments = int(self._orders.n_segments[places[0], places[-1]])
        if n_segments < self._settings.min_segments:
            return worst([now, uncertain(Reason.FEW_SEGMENTS)])
        if self.coverage < self._settings.min_coverage:
            return worst([now, uncertain(Reason.LOW_COVERAGE)])
        return now

    def _direction(self, line: int, shaft: int, bearing: int) -> tuple[Reading, Reading]:
        """Effective stiffness in one direction, and the coherence it rests on."""
        quality = self._line_quality(shaft, bearing)
        if isinstance(quality, Reading):
            return quality, quality
        few = int(self._orders.n_segments[shaft, bearing]) < self._settings.min_segments
        coherence = float(self._orders.coherence(shaft, bearing)[line])
        shown = missing(Reason.FEW_SEGMENTS) if few else Reading(coherence, quality)
        excited = (
            self._stands_out(line, bearing) if few else coherence >= self._settings.min_coherence
        )
        if few or line == VORTEX:  # what is no line must not be read as the vortex's
            excited = excited and self._stands_out(line, shaft)
        ratio = float(self._orders.amplitude_ratio(bearing, shaft)[line])
        if not excited or ratio <= 0.0:
            return missing(Reason.INSUFFICIENT_EXCITATION), shown
        stiffness = effective_stiffness_n_per_m(ratio, 1.0, self._bearing.bracket_stiffness_n_per_m)
        return Reading(stiffness, quality), shown

    def _stands_out(self, line: int, place: int) -> bool:
        """Whether a line stands above its surroundings, in which the other order lines lie too."""
        frequency_hz = self.spectrum.frequency_hz
        bins = (self._orders.frequency_hz / (frequency_hz[1] - frequency_hz[0])).round() - 1
        number = np.arange(frequency_hz.size)
        near = np.abs(number - bins[line]) <= FLOOR_REACH
        in_lobe = (np.abs(number[:, np.newaxis] - bins) <= MAIN_LOBE).any(axis=1)
        floor = np.median(self.spectrum.power[near & ~in_lobe, place, place])
        peak = self._orders.power[line, place, place]
        return bool(peak > self._settings.min_line_to_floor * floor)
