"""Settings of a CAN source: bus, DBC file, and meaning of the signals."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class CanLinkSettings:
    """Settings of a CAN bus, as arguments of python-can.

    Parameters
    ----------
    interface
        Interface of python-can: "socketcan", "slcan", "pcan", "kvaser", "vector", …
    channel
        Channel of the interface: "can0", "/dev/ttyACM0", "socket://192.0.2.17:4001".
    bitrate
        Bit rate in bit/s; None keeps the rate of the interface, as required for socketcan.
    fd
        Whether the bus carries CAN FD frames.
    data_bitrate
        Bit rate of the data phase of CAN FD frames, in bit/s; None keeps that of the interface.
    options
        Further arguments of python-can's interface, passed unchanged.
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
    """Waveform channel of a CAN device, with one signal for each sample in a frame.

    Parameters
    ----------
    unit
        Engineering unit of the channel: "um", "mm/s", "m/s2" or "V".
    signals
        Signals in order of time, each as "Message.Signal".
    """

    id: str
    unit: str
    signals: tuple[str, ...]


@dataclass(frozen=True)
class CanSlowChannel:
    """Slow channel of a CAN device, and the signal of its values as "Message.Signal"."""

    id: str
    unit: str
    signal: str


@dataclass(frozen=True, kw_only=True)
class CanSettings:
    """Settings of a measuring device on a CAN bus; signals are named "Message.Signal".

    Parameters
    ----------
    dbc
        Path of the DBC file.
    dbc_text
        Content of the DBC file if generated from a profile; None to read the file.
    counters
        Counter signals of the messages, at most one per message. Either all waveform messages have
        a counter, or none; without counters, the host counts the frames.
    counter_counts
        What the counters count: "samples" or "frames".
    frame_samples
        Signals with the number of valid samples in a multi-sample frame, if it varies.
    epoch
        Signal that changes when the device restarts its counters; None if there is none.
    ok_bits
        Signal with one bit per waveform channel, channel 0 lowest, that is set while the channel is
        OK; None if all channels are always OK.
    seconds
        Signal with the UTC time of the sample to which the message belongs, s since 1970; None to
        use arrival times.
    microseconds
        Signal with the microseconds within this second; None without `seconds`.
    hold_samples
        Number of samples, from its counter value on, for which a message without waveforms is
        valid; or the signal that contains this number.
    hold_s
        Time for which a message with neither waveforms nor counter is valid.
    stale_after_s
        Longest time without a new complete sample before the link counts as lost; above 0.
    stamps
        Source of arrival times: the "host" when it reads a frame, or the "interface".
    queue_frames
        Maximum number of frames queued for the event loop.
    when_full
        Behaviour if the queue is full: "drop" frames and count them, or "wait", for a device that
        can be paused without loss, such as a replay of a recording.
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
