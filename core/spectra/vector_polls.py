"""`Poll`: what a rack said of a unit at one moment, as displacement phasors and gaps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray, SampleArray
from core.machine.channel import displacement_factor
from core.machine.unit import Unit
from core.quality import Level, Quality, Reading, Reason, bad
from core.samples.blocks import SampleBlock
from core.spectra.lines import SegmentSettings
from core.spectra.overall import Overall
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import ORDER1, VORTEX, Segment
from core.spectra.speed import Speed, running_speed
from core.spectra.vector_rows import VectorPart, VectorRow
from core.units import hz_from_rpm, ns_from_s

NOT_GIVEN = bad(Reason.NOT_MEASURED)

_NO_LINES: FloatArray = np.empty(0)


@dataclass(frozen=True)
class Poll:
    """One poll of a unit.

    Parameters
    ----------
    phasors_um_pk
        (n_channels, 2) at 1× and at the vortex order, finite also where not usable; without a
        phase they are real, which only amplitudes may be read from.
    quality
        (n_channels) qualities at 1× and at the vortex order.
    has_phase
        (n_channels,) whether the phase at 1× is known.
    gaps
        As a segment, so that positions come from polls the way they come from waveforms.
    """

    index: int
    time_ns: int
    speed: Speed
    order_frequency_hz: FloatArray
    phasors_um_pk: ComplexArray
    quality: tuple[tuple[Quality, Quality], ...]
    has_phase: npt.NDArray[np.bool_]
    gaps: Segment

    @property
    def slow(self) -> Mapping[str, Reading]:
        """Slow readings of its moment."""
        return self.gaps.slow

    def usable(self, line: int) -> npt.NDArray[np.bool_]:
        """(n_channels,) whether each amplitude may be believed."""
        return np.array([quality[line].level is not Level.BAD for quality in self.quality])


class PollReader:
    """Makes polls of sample blocks whose rows are vectors.

    Raises
    ------
    ValueError
        If a row is of a channel that the unit has not, or there twice.
    """

    def __init__(self, unit: Unit, rows: Sequence[VectorRow], settings: SegmentSettings) -> None:
        self._unit, self._settings = unit, settings
        self._row = {(row.channel, row.part): n for n, row in enumerate(rows)}
        known = {channel.id for channel in unit.channels}
        for row in rows:
            if row.channel not in known:
                raise ValueError(f"row {row.id!r} is of no channel of unit {unit.id!r}")
        if len(self._row) < len(rows):
            raise ValueError(f"two of {len(rows)} rows are the same")

    def polls(self, block: SampleBlock) -> list[Poll]:
        """One for each sample of the block; they share its qualities and slow readings."""
        speed = running_speed(self._unit, block.slow, _NO_LINES, _NO_LINES, self._settings)
        turn_hz = hz_from_rpm(speed.rpm.value or self._unit.rated_speed_rpm)
        order_hz = turn_hz * np.array([1.0, self._settings.vortex_order])
        return [self._poll(block, n, speed, order_hz) for n in range(block.n_samples)]

    def _poll(self, block: SampleBlock, number: int, speed: Speed, order_hz: FloatArray) -> Poll:
        sample = block.samples[:, number]
        amplitude, quality = self._amplitudes(sample, block.channel_quality)
        angle_rad, has_phase = self._phases(sample, block.channel_quality)
        factor = np.array([displacement_factor(c, order_hz) for c in self._unit.channels])
        # without a phase the factor's own angle would pass for one
        turned: ComplexArray = np.where(has_phase[:, np.newaxis], factor, np.abs(factor))
        phasors: ComplexArray = amplitude * turned
        phasors[:, ORDER1] *= np.exp(1j * angle_rad)
        time_ns = block.start_ns + ns_from_s(number / block.rate_hz)
        index = block.first_index + number
        return Poll(
            index=index,
            time_ns=time_ns,
            speed=speed,
            order_frequency_hz=order_hz,
            phasors_um_pk=phasors,
            quality=quality,
            has_phase=has_phase,
            gaps=self._gaps(block, index, time_ns, speed, sample, order_hz),
        )

    def _quality(
        self, channel: str, part: VectorPart, sample: SampleArray, qualities: Sequence[Quality]
    ) -> tuple[float, Quality]:
        row = self._row.get((channel, part))
        if row is None:
            return 0.0, NOT_GIVEN
        value, quality = float(sample[row]), qualities[row]
        if quality.level is not Level.GOOD:
            return 0.0, bad(quality.reason)  # a rack's gap is a mean already
        return (value, quality) if np.isfinite(value) else (0.0, bad(Reason.NOT_FINITE))

    def _amplitudes(
        self, sample: SampleArray, qualities: Sequence[Quality]
    ) -> tuple[FloatArray, tuple[tuple[Quality, Quality], ...]]:
        found = [
            tuple(
                _not_below_zero(*self._quality(channel.id, part, sample, qualities))
                for part in (VectorPart.ORDER1_AMPLITUDE, VectorPart.VORTEX_AMPLITUDE)
            )
            for channel in self._unit.channels
        ]
        amplitude = np.array([[value for value, _ in pair] for pair in found])
        return amplitude, tuple((pair[ORDER1][1], pair[VORTEX][1]) for pair in found)

    def _phases(
        self, sample: SampleArray, qualities: Sequence[Quality]
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        found = [
            self._quality(channel.id, VectorPart.ORDER1_PHASE, sample, qualities)
            for channel in self._unit.channels
        ]
        known = np.array([quality.level is not Level.BAD for _, quality in found])
        return np.deg2rad([angle for angle, _ in found]), known

    def _gaps(
        self,
        block: SampleBlock,
        index: int,
        time_ns: int,
        speed: Speed,
        sample: SampleArray,
        order_hz: FloatArray,
    ) -> Segment:
        found = [
            self._quality(channel.id, VectorPart.GAP, sample, block.channel_quality)
            for channel in self._unit.channels
        ]
        n_channels = len(self._unit.channels)
        return Segment(
            epoch=block.epoch,
            first_index=index,
            stop_index=index + 1,
            stop_ns=time_ns,
            channel_quality=tuple(quality for _, quality in found),
            slow=block.slow,
            mean=np.array([gap_um for gap_um, _ in found]),
            speed=speed,
            bin_phasors_um_pk=np.zeros((n_channels, 0), dtype=np.complex128),
            order_frequency_hz=order_hz,
            has_vortex_peak=False,
            order_phasors_um_pk=np.zeros((n_channels, 2), dtype=np.complex128),
            runout={channel.id: RunoutVerdict.NO_VECTOR for channel in self._unit.channels},
            overall=Overall.of_nothing(n_channels, len(self._unit.bearings)),
            clipped_share=np.zeros(n_channels),
        )


def _not_below_zero(amplitude: float, quality: Quality) -> tuple[float, Quality]:
    return (amplitude, quality) if amplitude >= 0.0 else (0.0, bad(Reason.OUT_OF_RANGE))
