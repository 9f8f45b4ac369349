"""Decoding plan of a device's frames, and reasons for refusing frames."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from acquisition.can.dbc import DbcMessage
from acquisition.can.layout import ScalarReader, WaveformDecoder
from core.samples.blocks import UNCOUNTED_LOSS as UNCOUNTED
from core.samples.calibration import UnitCalibration

MAX_INSTANTS_PER_S = 1250.0
"""Maximum number of sample instants per second without counters: the clock drift within a second
is then less than half an instant, so that the clock shows the loss of a single instant."""

EPOCH, OK_BITS, HOLD = "epoch", "ok_bits", "hold_samples"
SECONDS, MICROSECONDS = "seconds", "microseconds"
QUANTITIES = (EPOCH, OK_BITS, SECONDS, MICROSECONDS, HOLD)
"""Side quantities (values sent with the samples) by their key in the settings; the other side
quantities are the slow values, with the number of the slow channel as key."""


@dataclass(eq=False)
class Part:
    """Signals of a message, or of one multiplexer value of a multiplexed message.

    Parameters
    ----------
    message
        Name of the message.
    wave
        Index of the part among the parts with waveforms; None if it has no waveforms.
    counter
        Reader of the counter, in samples; None without a counter.
    modulus
        Period of the counter in samples; 0 without a counter.
    n_samples
        Reader of the number of samples in a frame; None if the number is constant.
    epoch
        Reader of the epoch that the device reports; None without one.
    values
        Keys of the side quantities with their readers.
    """

    message: str
    wave: int | None = None
    counter: ScalarReader | None = None
    modulus: int = 0
    n_samples: ScalarReader | None = None
    epoch: ScalarReader | None = None
    values: list[tuple[str | int, ScalarReader]] = field(default_factory=list)


@dataclass(frozen=True)
class MessagePlan:
    """Decoding plan of the frames with one frame id.

    Parameters
    ----------
    message
        Message of the DBC file.
    multiplexer
        Reader of the multiplexer value; None for a message without multiplexer.
    parts
        Parts by multiplexer value; the only key is 0 for a message without multiplexer.
    """

    message: DbcMessage
    multiplexer: ScalarReader | None
    parts: dict[int, Part] = field(default_factory=dict)


class Plan:
    """Decoding plan of all frames of a device.

    Parameters
    ----------
    messages
        Decoding plan of each message by frame key.
    decoder
        Decoder of the waveform frames; it determines `samples_per_frame`.
    calibration
        Calibration of the unit: channels, slow channels and sampling rate.
    hold_samples
        Number of samples for which a message with counter but no waveforms is valid; None if a
        signal contains the number.
    hold_s
        Time for which a message with neither waveforms nor counter is valid.

    Attributes
    ----------
    samples_per_frame
        Number of samples per channel in one frame.
    n_waves
        Number of waveform messages.
    counted
        Whether any message has a counter.
    hold_uncounted
        `hold_s` in samples; at least 1.
    widest_modulus
        Largest modulus of all counters; 0 without counters.
    quantities
        All side quantities of the messages.
    reports_epoch
        Whether any message with a counter contains the epoch that the device reports.
    needs_header
        Whether the epoch is in a message with a counter but no waveforms; samples for which no
        such message is valid are refused.
    """

    def __init__(
        self,
        messages: Mapping[int, MessagePlan],
        decoder: WaveformDecoder,
        calibration: UnitCalibration,
        hold_samples: int | None,
        hold_s: float,
    ) -> None:
        self.messages, self.decoder, self.calibration = messages, decoder, calibration
        self.rate_hz, self.hold_samples = calibration.rate_hz, hold_samples
        self.hold_uncounted = max(1, round(hold_s * self.rate_hz))
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
    """Reason for refusing a frame or its samples; values name the counts of refusals."""

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
"""Number of refused frames or samples by reason."""
