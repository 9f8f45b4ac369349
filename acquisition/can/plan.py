"""What is done with each frame, and why frames are refused."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from acquisition.can.dbc import DbcMessage
from acquisition.can.layout import ScalarReader, WaveformDecoder
from core.samples.blocks import UNCOUNTED_LOSS as UNCOUNTED

MAX_INSTANTS_PER_S = 1250.0
"""Without counters: a second of drift is then less than half an instant, so that the loss of each
one shows by the clock."""

EPOCH, OK_BITS, SECONDS, MICROSECONDS, HOLD = "epoch", "ok_bits", "seconds", "microseconds", "hold"
"""Quantities that are carried beside the waveforms; slow values follow, by their number."""


@dataclass(frozen=True)
class MessageCounter:
    """A message's counter.

    Parameters
    ----------
    modulus
        Samples after which it is back where it was.
    step
        Samples that it counts as one.
    """

    read: ScalarReader
    modulus: int
    step: int


@dataclass(frozen=True)
class Part:
    """A message, or what it is at one value of its multiplexer.

    Parameters
    ----------
    wave
        Its number among those that carry waveforms; None if it carries none.
    n_samples
        Reader of the number of samples in a frame; None if it is always the same.
    values
        Quantities beside the waveforms and their readers.
    """

    name: str
    wave: int | None
    counter: MessageCounter | None
    n_samples: ScalarReader | None
    values: tuple[tuple[str | int, ScalarReader], ...]
    epoch: ScalarReader | None


@dataclass(frozen=True)
class MessagePlan:
    """How to read the frames of one id.

    Parameters
    ----------
    parts
        By value of the multiplexer; without one, the only key is 0.
    """

    message: DbcMessage
    multiplexer: ScalarReader | None
    parts: dict[int, Part] = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """How all frames of a device are read.

    Parameters
    ----------
    messages
        By frame key.
    n_waves
        Messages that carry waveforms.
    samples_per_frame
        Of each channel.
    quantities
        All that is carried beside the waveforms.
    """

    messages: Mapping[int, MessagePlan]
    n_waves: int
    samples_per_frame: int
    decoder: WaveformDecoder
    counted: bool
    widest_modulus: int
    quantities: frozenset[str | int]
    hold_samples: int | None

    @property
    def reports_epoch(self) -> bool:
        """Whether counted messages carry the epoch of the count."""
        parts = (part for m in self.messages.values() for part in m.parts.values())
        return any(part.epoch is not None and part.counter is not None for part in parts)


class Refusal(StrEnum):
    """Why a frame, or the samples it belongs to, are not used; the names become counters."""

    INCOMPLETE = "incomplete_frames"
    WRONG_LENGTH = "wrong_length"
    NO_HEADER = "no_header"
    NO_TIME = "no_time_stamp"
    UNCOUNTED_LOSS = UNCOUNTED
    DUPLICATE = "duplicate_frame"
    CONTRADICTORY = "contradictory_frame"
    OUT_OF_ORDER = "out_of_order_frame"
    IMPOSSIBLE_COUNTER = "impossible_counter"
    BEFORE_START = "before_start"
    UNDECODABLE = "undecodable_frame"
    REMOTE = "remote_frame"
    ERROR = "error_frame"
    FD = "fd_frame"
    CLASSIC = "classic_frame"
    OTHER_ID_KIND = "other_id_kind"
    FOREIGN = "foreign_id"
    MALFORMED = "malformed_line"
    OVERFLOW = "queue_overflow"


RefusalCounts = Counter[Refusal]
"""Frames, or samples, by reason."""
