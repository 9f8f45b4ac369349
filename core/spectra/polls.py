"""Polls of a monitoring rack: a unit's vibration vectors at one moment, as a segment without bins.

A block of a rack has one sample for each poll and one row for each quantity that the rack reports
for a channel: amplitudes zero-to-peak in the channel's engineering unit, phases in degrees,
positive if the reading leads the key-phase, gaps in micrometres. Each row has its own quality.
Speed and temperatures are slow channels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.channel import displacement_factors
from core.machine.unit import Unit
from core.quality import Level, Quality, Reason, bad
from core.samples.ring import Window
from core.spectra.lines import SegmentSettings
from core.spectra.overall import RecentVibration
from core.spectra.runout import runout_verdict
from core.spectra.segments import ORDER1, VORTEX, KeptSegments, Segment, usable_channels
from core.spectra.speed import running_speed
from core.units import hz_from_rpm

NOT_GIVEN = bad(Reason.NOT_MEASURED)

_NO_LINES: FloatArray = np.empty(0)


class VectorPart(StrEnum):
    """Quantity that a monitoring rack reports for a channel."""

    ORDER1_AMPLITUDE = "order1_amplitude"
    ORDER1_PHASE = "order1_phase"
    VORTEX_AMPLITUDE = "vortex_amplitude"
    OVERALL = "overall"
    GAP = "gap"


AMPLITUDE_PARTS = (
    VectorPart.ORDER1_AMPLITUDE,
    VectorPart.VORTEX_AMPLITUDE,
    VectorPart.OVERALL,
)
"""Quantities that are amplitudes. The overall amplitude is recorded but not evaluated."""


@dataclass(frozen=True)
class VectorRow:
    """Row of a rack's block: channel id and quantity."""

    channel: str
    part: VectorPart

    @property
    def id(self) -> str:
        """Id of the row in register maps: channel id, dot, quantity."""
        return f"{self.channel}.{self.part}"


@dataclass(frozen=True)
class PollSettings:
    """Settings for averaging the polls of a rack.

    Parameters
    ----------
    n_polls
        Number of polls in the averaging window; 60 polls every 5 s are five minutes.
    hop_polls
        Number of polls from one result to the next, at most `n_polls`; vibration limits are
        evaluated at each result.
    min_polls
        Number of polls with a changed vector below which a result is uncertain; 2 to `n_polls`.
    """

    n_polls: int = 60
    hop_polls: int = 4
    min_polls: int = 4


class PollTransform(KeptSegments):
    """Transform of a rack's polls to segments without bins, which it keeps for averaging.

    Parameters
    ----------
    unit
        Unit; its rate is the rate of the polls.
    rows
        Channel and quantity of each row of a block.
    settings
        Settings of speed and vortex; lengths of segments are not used.
    averaging
        Settings for averaging the polls; None for the default `PollSettings`.

    Raises
    ------
    ValueError
        If the channel of a row is unknown, or a row is repeated.
    """

    def __init__(
        self,
        unit: Unit,
        rows: Sequence[VectorRow],
        settings: SegmentSettings,
        averaging: PollSettings | None = None,
    ) -> None:
        averaging = averaging or PollSettings()
        n_polls, hop_polls = averaging.n_polls, averaging.hop_polls
        super().__init__(len(rows), n_polls, averaging.min_polls, result_samples=hop_polls)
        self._unit, self._settings = unit, settings
        self._row = {(row.channel, row.part): n for n, row in enumerate(rows)}
        known = {channel.id for channel in unit.channels}
        for row in rows:
            if row.channel not in known:
                raise ValueError(f"row {row.id!r}: unit {unit.id!r} has no channel {row.channel!r}")
        if len(self._row) < len(rows):
            raise ValueError("rows must be unique: two rows have the same channel and quantity")
        # the phase reference of a rack differs from that of padwatch's slow-roll vectors
        self._runout = {
            c.id: runout_verdict(c, unit.rated_speed_rpm, has_key_phase=False)
            for c in unit.channels
        }

    def add(self, window: Window) -> Segment:
        """Convert a window with a single sample (one poll) to a segment, keep it and return it."""
        speed = running_speed(self._unit, window.slow, _NO_LINES, _NO_LINES, self._settings)
        turn_hz = hz_from_rpm(speed.rpm.value or self._unit.rated_speed_rpm)
        order_hz = turn_hz * np.array([1.0, self._settings.vortex_order])
        of_line = [
            self._of_channels(part, window, least=0.0)
            for part in (VectorPart.ORDER1_AMPLITUDE, VectorPart.VORTEX_AMPLITUDE)
        ]
        amplitude = np.stack([values for values, _ in of_line], axis=1)
        quality = of_line[ORDER1][1], of_line[VORTEX][1]
        angle_deg, angle_quality = self._of_channels(VectorPart.ORDER1_PHASE, window)
        has_phase = usable_channels(angle_quality)
        factor = displacement_factors(self._unit.channels, order_hz)
        # without a phase, the angle of the factor would look like a measured one
        turned: ComplexArray = np.where(has_phase[:, np.newaxis], factor, np.abs(factor))
        phasors: ComplexArray = amplitude * turned
        phasors[:, ORDER1] *= np.exp(1j * np.deg2rad(angle_deg))
        gap_um, gap_quality = self._of_channels(VectorPart.GAP, window)
        order1_um_pk = np.abs(phasors[np.newaxis, :, ORDER1])
        nothing_um: FloatArray = np.full_like(order1_um_pk, np.nan)
        return self.keep(
            Segment(
                epoch=window.epoch,
                first_index=window.first_index,
                stop_index=window.stop_index,
                stop_ns=window.start_ns,
                channel_quality=gap_quality,
                usable=usable_channels(gap_quality),
                slow=window.slow,
                mean=gap_um,
                speed=speed,
                bin_phasors_um_pk=None,
                order_frequency_hz=order_hz,
                has_vortex_peak=False,
                order_phasors_um_pk=phasors,
                order_quality=quality,
                order_usable=np.array([usable_channels(of_line) for of_line in quality]),
                has_phase=np.array([has_phase, np.zeros_like(has_phase)]),
                at_mark_um_pk=np.where(has_phase, phasors[:, ORDER1], np.nan),
                runout=self._runout,
                overall=None,
                clipped_share=np.zeros(gap_um.size),
                recent=RecentVibration(np.array([window.n_samples]), order1_um_pk, nothing_um),
            )
        )

    def _of_channels(
        self, part: VectorPart, window: Window, least: float = -math.inf
    ) -> tuple[FloatArray, tuple[Quality, ...]]:
        """Return values and qualities of a quantity, (n_channels,); unusable values are zero."""
        found = [self._row_of(channel.id, part, window, least) for channel in self._unit.channels]
        return np.array([value for value, _ in found]), tuple(quality for _, quality in found)

    def _row_of(
        self, channel: str, part: VectorPart, window: Window, least: float
    ) -> tuple[float, Quality]:
        row = self._row.get((channel, part))
        if row is None:
            return 0.0, NOT_GIVEN
        value, quality = float(window.samples[row, 0]), window.channel_quality[row]
        if quality.level is not Level.GOOD:
            return 0.0, bad(quality.reason)  # uncertain is also bad: a rack's gap is already a mean
        if not math.isfinite(value):
            return 0.0, bad(Reason.NOT_FINITE)
        return (value, quality) if value >= least else (0.0, bad(Reason.OUT_OF_RANGE))
