"""What the rows of a sample block are when a rack delivers vectors instead of waveforms.

Such a block has one sample for each poll, and a row for each quantity that the rack gives of a
channel: amplitudes zero-to-peak in the channel's engineering unit, phases in degrees, positive
where the reading leads the key-phase, gaps in micrometres. Each row has its own quality. Speed and
temperatures are slow channels, as ever.
"""

from dataclasses import dataclass
from enum import StrEnum


class VectorPart(StrEnum):
    """What a rack gives of a channel."""

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
"""Parts that have a detector; the overall amplitude is carried along, nothing is made of it."""


@dataclass(frozen=True)
class VectorRow:
    """One row: which channel, by id, and what of it."""

    channel: str
    part: VectorPart

    @property
    def id(self) -> str:
        """Name of the row, in register maps."""
        return f"{self.channel}.{self.part}"
