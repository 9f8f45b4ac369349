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

EPOCH, OK_BITS, HOLD = "epoch", "ok_bits", "hold_samples"
SECONDS, MICROSECONDS = "seconds", "microseconds"
QUANTITIES = (EPOCH, OK_BITS, SECONDS, MICROSECONDS, HOLD)
"""Quantities beside the waveforms, as their keys in the settings; slow values go by number."""


@dataclass(eq=False)
class Part:
    """A message, or what it is at one value of its multiplexer.

    Parameters
    ----------
    message
        Its name.
    wave
        Its number among those that carry waveforms; None if it carries none.
    counter
        Reader of its counter, in frames or samples; None if it has none.
    counter_step
        Samples that the counter counts as one.
    modulus
        Samples after which the counter is back where it was.
    n_samples
        Reader of the number of samples in a frame; None if it is always the same.
    values
        Quantities beside the waveforms and their readers.
    """

    message: str
    wave: int | None = None
    counter: ScalarReader | None = None
    counter_step: int = 1
    modulus: int = 0
    n_samples: ScalarReader | None = None
    epoch: ScalarReader | None = None
    values: list[tuple[str | int, ScalarReader]] = field(default_factory=list)


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


class Plan:
    """How all frames of a device are read.

    Parameters
    ----------
    messages
        By frame key.
    n_slow
        Slow channels.
    hold_samples
        For how many samples a counted message without waveforms is valid; None if it is sent.
    hold_s
        For how long a message without waveforms and without counter is valid.

    Attributes
    ----------
    samples_per_frame
        Of each channel.
    n_waves
        Messages that carry waveforms.
    widest_modulus
        Of all counters; 0 without any.
    quantities
        All that is carried beside the waveforms.
    reports_epoch
        Whether counted messages carry the epoch of the count.
    needs_header
        Whether a counted message without waveforms does.
    """

    def __init__(
        self,
        messages: Mapping[int, MessagePlan],
        decoder: WaveformDecoder,
        n_slow: int,
        rate_hz: float,
        hold_samples: int | None,
        hold_s: float,
    ) -> None:
        self.messages, self.decoder, self.n_slow = messages, decoder, n_slow
        self.rate_hz, self.hold_samples = rate_hz, hold_samples
        self.hold_uncounted = max(1, round(hold_s * rate_hz))
        self.n_channels = len(decoder.channels)
        self.samples_per_frame = len(decoder.channels[0].columns)
        parts = [part for message in messages.values() for part in message.parts.values()]
        self.n_waves = sum(part.wave is not None for part in parts)
        self.widest_modulus = max(part.modulus for part in parts)
        self.counted = self.widest_modulus > 0
        self.quantities = frozenset(key for part in parts for key, _ in part.values)
        with_epoch = [part for part in parts if part.epoch and part.counter]
        self.reports_epoch = bool(with_epoch)
        self.needs_header = any(part.wave is None for part in with_epoch)


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
