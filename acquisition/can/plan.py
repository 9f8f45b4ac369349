"""`Plan`: what has to be done with each frame, as it follows from settings and DBC."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from acquisition.can.dbc import DbcMessage
from acquisition.can.layout import ScalarReader
from acquisition.can.waveforms import WaveformDecoder

EPOCH, OK_BITS, SECONDS, MICROSECONDS, HOLD = "epoch", "ok_bits", "seconds", "microseconds", "hold"
"""Quantities that are carried beside the waveforms; slow values follow, by their number."""


@dataclass(frozen=True)
class Counter:
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
    counter: Counter | None
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
