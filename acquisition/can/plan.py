"""What is done with each frame, and the sample instants that frames make."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from acquisition.can.dbc import DbcMessage
from acquisition.can.layout import ScalarReader, WaveformDecoder
from core.samples.blocks import UNCOUNTED_LOSS as UNCOUNTED

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
    """All that the assembly needs to know.

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


@dataclass(frozen=True)
class Instant:
    """A complete set of frames.

    Parameters
    ----------
    epoch
        Of the device's count.
    index
        Of the first sample.
    n_samples
        Valid samples of each channel, at most those that a frame can carry.
    frames
        One for each waveform message.
    rejected
        Samples refused directly before, by reason.
    """

    epoch: int
    index: int
    n_samples: int
    frames: tuple[bytes, ...]
    rejected: Mapping[Refusal, int] = field(default_factory=dict)

    @property
    def stop_index(self) -> int:
        """Index of the first sample after it."""
        return self.index + self.n_samples


class PendingInstant:
    """A set of frames that is still being collected."""

    def __init__(self, n_waves: int, n_samples: int) -> None:
        self._frames: list[bytes | None] = [None] * n_waves
        self._n_missing = n_waves
        self.n_samples = n_samples
        self._spoilt = False

    def put(self, wave: int, data: bytes, n_samples: int) -> tuple[bytes, ...] | None:
        """Take a frame; return all of them once they are complete and agree with each other."""
        if self._frames[wave] is None:
            self._n_missing -= 1
        self._frames[wave] = data
        self._spoilt |= n_samples != self.n_samples
        if self._n_missing or self._spoilt:
            return None
        return tuple(frame for frame in self._frames if frame is not None)


RefusalCounts = Counter[Refusal]
"""Frames, or samples, by reason."""
