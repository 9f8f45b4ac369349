"""Transform of sample windows to segments, and the segments kept for averaging."""

import cmath
import copy
import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.checks.sensor_checks import (
    MAX_CLIPPED_SHARE,
    clipped_share,
    level_quality,
    quietest_rms,
    signal_quality,
)
from core.machine.channel import displacement_factors
from core.machine.unit import Unit
from core.quality import GOOD, Level, Quality, Reading, Reason, bad, missing, uncertain, worst
from core.samples.ring import Window
from core.spectra.cross_spectrum import average, shared_power
from core.spectra.lines import (
    SegmentSettings,
    bin_phasors,
    line_phasors,
    part_phasors,
    peak_frequency_hz,
    taper_weights,
    turning_factors,
)
from core.spectra.overall import Overall, OverallTransform, RecentVibration, parts_of
from core.spectra.resolution import Resolution
from core.spectra.runout import RunoutVerdict, shaft_angle_rad, without_runout
from core.spectra.speed import KeyPhase, Speed, read_key_phase, running_speed
from core.units import hz_from_rpm

OUTSIDE = uncertain(Reason.SENSOR_FAILURE)
"""Quality of a channel with the mean of a cell outside its OK limits."""

CLIPPED = bad(Reason.CLIPPED)

ORDER1, VORTEX = range(2)
"""Columns of the two order lines in `Segment.order_phasors_um_pk`."""


class Evidence(StrEnum):
    """Kind of input that results are computed from. The names appear in the API."""

    WAVEFORMS = "waveforms"
    AMPLITUDE_AND_PHASE = "amplitude_and_phase"
    AMPLITUDE_ONLY = "amplitude_only"


@dataclass(frozen=True)
class Segment:
    """Fourier-transformed segment of a unit's samples, or one poll of its rack.

    Parameters
    ----------
    stop_index, stop_ns
        Index and time of the first sample after the segment; for a poll, `stop_ns` is its time.
    channel_quality
        Quality of each channel in the whole segment; for a poll, the quality of the gaps.
    usable : (n_channels,)
        Whether the samples of each channel are usable (not bad).
    mean
        (n_channels,) mean of the samples, in the engineering unit of each channel.
    bin_phasors_um_pk
        (n_channels, n_lines) displacement phasors at the bins above zero, along x and y; None for a
        poll.
    order_frequency_hz
        (2,) exact frequencies of 1× and of the vortex; without a vortex peak, the nominal frequency
        of the vortex.
    has_vortex_peak
        Whether the spectra averaged up to this segment have a peak, shared by shaft and bearing, in
        the vortex band.
    order_phasors_um_pk
        (n_channels, 2) displacement phasors at exactly `order_frequency_hz`, finite also if not
        usable; amplitudes if the phase is unknown. Runout is subtracted from 1× if possible. The
        phasors of two transducers in other directions than x and y are resolved into x and y.
    order_quality
        (2, n_channels) qualities of `order_phasors_um_pk`.
    order_usable : (2, n_channels)
        Whether each of these phasors is usable.
    has_phase : (2, n_channels)
        Whether the phase of each of these phasors is known.
    at_mark_um_pk : (n_channels,)
        1× phasors with the phase at the passage of the shaft's mark; NaN if unknown.
    runout
        Whether runout was subtracted from 1×, by shaft channel.
    overall
        Broad-band vibration; None for a poll.
    clipped_share
        (n_channels,) fraction of the samples at an end of the converter's range.
    recent
        Vibration of the newest parts; for a poll, its 1× vibration.
    """

    epoch: int
    first_index: int
    stop_index: int
    stop_ns: int
    channel_quality: tuple[Quality, ...]
    usable: BoolArray
    slow: Mapping[str, Reading]
    mean: FloatArray
    speed: Speed
    bin_phasors_um_pk: ComplexArray | None
    order_frequency_hz: FloatArray
    has_vortex_peak: bool
    order_phasors_um_pk: ComplexArray
    order_quality: tuple[tuple[Quality, ...], tuple[Quality, ...]]
    order_usable: BoolArray
    has_phase: BoolArray
    at_mark_um_pk: ComplexArray
    runout: Mapping[str, RunoutVerdict]
    overall: Overall | None
    clipped_share: FloatArray
    recent: RecentVibration

    def is_grazed(self, row: int) -> bool:
        """Whether a channel is bad only because of a few clipped samples."""
        few = 0.0 < self.clipped_share[row] <= MAX_CLIPPED_SHARE
        return bool(few) and self.channel_quality[row] == CLIPPED

    def line_quality(self, row: int, line: int) -> Quality:
        """Return a channel's quality at `ORDER1` or `VORTEX`: uncertain if `is_grazed`."""
        return uncertain(Reason.CLIPPED) if self.is_grazed(row) else self.order_quality[line][row]

    @cached_property
    def means(self) -> tuple[Reading, ...]:
        """Mean of each channel in its unit, in channel order; bad if the channel is."""
        return self._of_channels(self.mean)

    @cached_property
    def spans_um_pp(self) -> tuple[Reading, ...]:
        """Broad-band peak-to-peak displacement, in µm, of each channel; bad if not measured."""
        return self._of_channels(None if self.overall is None else self.overall.peak_to_peak_um)

    @cached_property
    def velocities_mm_s_rms(self) -> tuple[Reading, ...]:
        """Broad-band rms velocity of each channel, in mm/s, in channel order.

        A reading has no value if its channel is bad, or if the segment is a poll.
        """
        return self._of_channels(None if self.overall is None else self.overall.velocity_mm_s_rms)

    @cached_property
    def velocity_squares(self) -> tuple[Reading, ...]:
        """Squares of `velocities_mm_s_rms`, whose mean is the square of an average."""
        return tuple(
            r if r.value is None else Reading(r.value**2, r.quality)
            for r in self.velocities_mm_s_rms
        )

    @cached_property
    def orbits_um_pk(self) -> tuple[Reading, ...]:
        """Largest displacement of the shaft in each bearing, in µm; empty for a poll."""
        if self.overall is None:
            return ()
        orbits = zip(self.overall.shafts, self.overall.orbit_um_pk.tolist(), strict=True)
        return tuple(self.reading(rows, value) for rows, value in orbits)

    def _of_channels(self, values: FloatArray | None) -> tuple[Reading, ...]:
        each = [math.nan] * self.usable.size if values is None else values.tolist()
        return tuple(self.reading((row,), value) for row, value in enumerate(each))

    def reading(self, rows: Sequence[int], value: float) -> Reading:
        """Return a reading with the channels' worst quality; without a value if `value` is NaN."""
        quality = worst([self.channel_quality[row] for row in rows])
        if quality.level is Level.BAD:
            return missing(quality.reason)
        return missing(Reason.NOT_MEASURED) if math.isnan(value) else Reading(value, quality)


class KeptSegments:
    """Segments or polls of the averaging window.

    Parameters
    ----------
    n_segments
        Number of segments in a full averaging window.
    min_segments
        Number of independent segments below which a result is uncertain.
    segment_samples, hop_samples
        Samples per segment, and between the starts of consecutive segments.
    result_samples
        Results are due at the first segment that ends at or after each multiple of this number of
        samples.
    n_rows
        Number of rows of a block.

    Attributes
    ----------
    frequency_hz
        (n_lines,) frequencies of the bins; None for polls.
    segments
        Segments or polls of the averaging window, oldest first.
    """

    frequency_hz: FloatArray | None = None

    def __init__(
        self,
        n_rows: int,
        n_segments: int,
        min_segments: int,
        segment_samples: int = 1,
        hop_samples: int = 1,
        result_samples: int = 1,
    ) -> None:
        self.n_rows, self.n_segments, self.min_segments = n_rows, n_segments, min_segments
        self.segment_samples, self.hop_samples = segment_samples, hop_samples
        self.result_samples = result_samples
        self.segments: deque[Segment] = deque(maxlen=n_segments)

    def clear(self) -> None:
        """Drop all segments, after a restart of the sample count."""
        self.segments.clear()

    def snapshot(self) -> "KeptSegments":
        """Return a copy of this object, to which later segments are not added."""
        found = copy.copy(self)
        found.segments = self.segments.copy()
        return found

    def keep(self, segment: Segment) -> Segment:
        """Append and return a segment; drop the segments outside the averaging window."""
        self.segments.append(segment)
        self.drop_before(segment.first_index - self.n_segments * self.hop_samples + 1)
        return segment

    def drop_before(self, first_index: int) -> None:
        """Drop the segments that begin before a sample index."""
        while self.segments and self.segments[0].first_index < first_index:
            self.segments.popleft()


class SegmentTransform(KeptSegments):
    """Transform of one unit's sample windows to segments, which it keeps for averaging."""

    def __init__(self, unit: Unit, settings: SegmentSettings) -> None:
        super().__init__(
            len(unit.channels),
            settings.n_segments,
            settings.min_segments,
            settings.segment_samples,
            settings.hop_samples,
        )
        self._unit = unit
        self._settings = settings
        bin_hz = unit.rate_hz / settings.segment_samples
        n_lines = min(int(settings.max_frequency_hz / bin_hz), settings.segment_samples // 2 - 1)
        self.frequency_hz: FloatArray = bin_hz * np.arange(1, n_lines + 1, dtype=np.float64)
        self._overall = OverallTransform(unit, settings)
        self._resolution = Resolution(unit)
        self._bin_factor = displacement_factors(unit.channels, self.frequency_hz)
        shafts = {id_ for bearing in unit.bearings for id_ in (bearing.shaft_x, bearing.shaft_y)}
        self._is_shaft = np.array([channel.id in shafts for channel in unit.channels])
        ids = [channel.id for channel in unit.channels]
        self._key_phase_row = ids.index(unit.key_phase) if unit.key_phase else None
        self._bearing_rows = [[ids.index(i) for i in b.channels] for b in unit.bearings]

    def add(self, window: Window) -> Segment:
        """Transform a window to a segment, keep it for averaging, and return it.

        Segments outside the averaging window are dropped before the vortex search: after a gap they
        may be arbitrarily old.
        """
        self.drop_before(window.first_index - self.n_segments * self.hop_samples)
        samples: FloatArray = window.samples.astype(np.float64)
        with np.errstate(invalid="ignore"):  # infinities of both signs give NaN
            mean: FloatArray = samples.mean(axis=1)
        finite = np.isfinite(mean)  # sums of single-precision values do not overflow
        samples[~finite], mean[~finite] = 0.0, 0.0
        quality = tuple(
            q if good or q.level is Level.BAD else bad(Reason.NOT_FINITE)
            for q, good in zip(window.channel_quality, finite.tolist(), strict=True)
        )
        centred = samples - mean[:, np.newaxis]
        prepared = centred * taper_weights(samples.shape[1])
        lines = bin_phasors(prepared, prepared.shape[1] // 2 - 1)
        bins = self._resolution.phasors(lines[:, : self.frequency_hz.size] * self._bin_factor)
        usable = usable_channels(quality)
        key_phase = self._key_phase(samples, window.rate_hz, usable)
        shaft_power: FloatArray = (np.abs(bins[usable & self._is_shaft]) ** 2).sum(axis=0)
        speed = running_speed(
            self._unit, window.slow, self.frequency_hz, shaft_power, self._settings, key_phase
        )
        turn_hz = hz_from_rpm(speed.rpm.value or self._unit.rated_speed_rpm)
        turn_samples, is_turning = window.rate_hz / turn_hz, speed.rpm.value is not None
        clipped = self._clipped(quality, samples)
        quality = self._judged(quality, samples, mean, is_turning, turn_samples)
        resolved = self._resolution.qualities(quality)
        usable = usable_channels(resolved)
        vortex_hz = self._vortex_hz(turn_hz, bins, usable)
        order_hz = np.array([turn_hz, vortex_hz or self._settings.vortex_order * turn_hz])
        factors = displacement_factors(self._unit.channels, order_hz)
        turning = turning_factors(samples.shape[1], window.rate_hz, order_hz)
        orders = factors * line_phasors(prepared, turning)
        shafts = np.flatnonzero(self._is_shaft).tolist()
        orders[:, ORDER1], runout = without_runout(
            orders[:, ORDER1], self._unit, shafts, speed, key_phase
        )
        orders = self._resolution.phasors(orders)
        angle_rad = shaft_angle_rad(speed, key_phase)
        segment = Segment(
            epoch=window.epoch,
            first_index=window.first_index,
            stop_index=window.stop_index,
            stop_ns=window.stop_ns,
            channel_quality=quality,
            usable=usable_channels(quality),
            slow=window.slow,
            mean=mean,
            speed=speed,
            bin_phasors_um_pk=bins,
            order_frequency_hz=order_hz,
            has_vortex_peak=vortex_hz is not None,
            order_phasors_um_pk=orders,
            order_quality=(resolved, resolved),
            order_usable=np.array([usable, usable]),
            has_phase=np.ones((2, usable.size), dtype=np.bool_),
            at_mark_um_pk=_turned_back(orders[:, ORDER1], angle_rad),
            runout=runout,
            overall=self._overall.of(samples, centred, lines),
            clipped_share=clipped,
            recent=self._recent(samples, turn_samples, turning, factors, speed, key_phase),
        )
        return self.keep(segment)

    def _judged(
        self,
        quality: tuple[Quality, ...],
        samples: FloatArray,
        mean: FloatArray,
        is_turning: bool,
        turn_samples: float,
    ) -> tuple[Quality, ...]:
        """Return the channel qualities after checks of signal and level; bad for failed sensors."""
        limits, found = self._settings.sensors, []
        moved = zip(quality, self._unit.channels, quietest_rms(samples), mean, samples, strict=True)
        for before, channel, rms, at, own in moved:
            signal = signal_quality(rms, at, channel.unit_per_count, is_turning, limits)
            if before in (OUTSIDE, CLIPPED):
                # a breaking cable clips first; the lost signal is the more important reason
                level = level_quality(own, round(turn_samples), channel.ok_limits)
                found.append(worst((signal, level, GOOD if before == OUTSIDE else before)))
            else:
                found.append(worst((before, signal)))
        return tuple(found)

    def _clipped(self, quality: tuple[Quality, ...], samples: FloatArray) -> FloatArray:
        return np.array(
            [
                clipped_share(own, c.unit_per_count) if q == CLIPPED and c.unit_per_count else 0.0
                for q, c, own in zip(quality, self._unit.channels, samples, strict=True)
            ]
        )

    def _key_phase(self, samples: FloatArray, rate_hz: float, usable: BoolArray) -> KeyPhase | None:
        row = self._key_phase_row
        if row is None or not usable[row]:
            return None
        return read_key_phase(self._unit.channels[row].direction * samples[row], rate_hz)

    def _recent(
        self,
        samples: FloatArray,
        turn_samples: float,
        turning: ComplexArray,
        factors: ComplexArray,
        speed: Speed,
        key_phase: KeyPhase | None,
    ) -> RecentVibration:
        starts, stops = parts_of(samples.shape[1], self._settings.hop_samples, turn_samples)
        shafts = np.flatnonzero(self._is_shaft).tolist()
        amplitudes, spans = [], []
        for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
            part = samples[:, start:stop]
            at_turn = np.ascontiguousarray(turning[start:stop, ORDER1 : ORDER1 + 1])
            phasors = factors[:, ORDER1] * part_phasors(part, at_turn)[:, 0]
            clean, _ = without_runout(phasors, self._unit, shafts, speed, key_phase)
            amplitudes.append(np.abs(self._resolution.phasors(clean)))
            spans.append(np.ptp(part, axis=1))
        return RecentVibration(stops, np.array(amplitudes), np.array(spans))

    def _vortex_hz(self, turn_hz: float, bins: ComplexArray, usable: BoolArray) -> float | None:
        """Return the vortex frequency in the spectra averaged up to now; None without a vortex."""
        low, high = self._settings.vortex_band
        band_hz = (low * turn_hz, high * turn_hz)
        # one more bin on each side, to distinguish a peak from the flank of a line outside
        margin_hz = 1.5 * self.frequency_hz[0]
        first = int(np.searchsorted(self.frequency_hz, band_hz[0] - margin_hz, "right"))
        near = slice(first, int(np.searchsorted(self.frequency_hz, band_hz[1] + margin_hz)))
        before = [s.bin_phasors_um_pk for s in self.segments if s.bin_phasors_um_pk is not None]
        phasors = np.array([part[:, near] for part in (*before, bins)])
        counted = np.array([*(s.order_usable[VORTEX] for s in self.segments), usable])
        spectra = [
            average(self.frequency_hz[near], phasors[:, rows], counted[:, rows])
            for rows in self._bearing_rows
        ]
        return peak_frequency_hz(shared_power(spectra), self.frequency_hz[near], band_hz)


def usable_channels(qualities: Sequence[Quality]) -> BoolArray:
    """Return a mask (n_channels,) of the channels that are not bad."""
    return np.array([quality.level is not Level.BAD for quality in qualities])


def _turned_back(phasors: ComplexArray, angle_rad: float | None) -> ComplexArray:
    factor = complex(math.nan) if angle_rad is None else cmath.exp(1j * -angle_rad)
    return np.array([phasor * factor for phasor in phasors.tolist()])
