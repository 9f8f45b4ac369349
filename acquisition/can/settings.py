"""Settings of a CAN source: the bus, the DBC, and what each signal means."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class CanLinkSettings:
    """A bus, in the words of python-can.

    Parameters
    ----------
    interface
        One of python-can's interfaces: "socketcan", "slcan", "pcan", "kvaser", "vector", …
    channel
        What that interface calls a channel: "can0", "/dev/ttyACM0", "socket://192.0.2.17:4001".
    bitrate, data_bitrate
        In bit/s; None leaves the interface as it is, as socketcan must be.
    fd
        Whether the bus carries CAN FD frames.
    options
        Further arguments of python-can's interface, handed on as they are.
    """

    interface: str
    channel: str
    bitrate: int | None = None
    fd: bool = False
    data_bitrate: int | None = None
    options: Mapping[str, str | int | float | bool] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.interface} {self.channel}"


@dataclass(frozen=True)
class CanChannel:
    """A waveform channel: one signal, or one for each sample that a frame carries, in order.

    Parameters
    ----------
    unit
        Engineering unit of the channel: "um", "mm/s", "m/s2" or "V".
    signals
        As "Message.Signal".
    """

    id: str
    unit: str
    signals: tuple[str, ...]


@dataclass(frozen=True)
class CanSlowChannel:
    """A slow channel and the signal that carries it, as "Message.Signal"."""

    id: str
    unit: str
    signal: str


@dataclass(frozen=True, kw_only=True)
class CanSettings:
    """A measuring device on a CAN bus; signals are named "Message.Signal".

    Parameters
    ----------
    dbc
        The DBC file.
    dbc_text
        Its text, where it follows from a profile and there is no file.
    counters
        Signals that count the sample that a message belongs to, at most one for each message. All
        messages of the waveform channels have one, or none has; without, frames are counted.
    counter_counts
        Whether these counters count samples or frames.
    frame_samples
        Signals that give the number of samples in a multi-sample frame, if it can be fewer.
    epoch
        Changes when the device begins to count anew.
    ok_bits
        Bit c, the lowest first, is set while waveform channel c is healthy.
    seconds, microseconds
        UTC of the sample that the message belongs to.
    hold_samples
        For how many samples, from the one its counter names, a message without waveforms is valid:
        a number, or the signal that gives it.
    hold_s
        For how long a message without waveforms and without counter is valid.
    stale_after_s
        A bus without a complete new sample for longer than this is not connected; above 0.
    stamps
        Whether the "host" stamps frames as they are read, or the "interface" does.
    queue_frames
        Frames that wait for the event loop at most.
    when_full
        "drop" and count frames if the queue is full, or "wait", so that a device that can wait,
        as one that replays a recording does, loses nothing.
    """

    link: CanLinkSettings
    dbc: Path
    dbc_text: str | None = None
    channels: tuple[CanChannel, ...]
    slow: tuple[CanSlowChannel, ...] = ()
    counters: tuple[str, ...] = ()
    counter_counts: Literal["samples", "frames"] = "samples"
    frame_samples: tuple[str, ...] = ()
    epoch: str | None = None
    ok_bits: str | None = None
    seconds: str | None = None
    microseconds: str | None = None
    hold_samples: int | str = 50
    hold_s: float = 5.0
    stale_after_s: float = 1.0
    stamps: Literal["host", "interface"] = "host"
    queue_frames: int = 65536
    when_full: Literal["drop", "wait"] = "drop"
