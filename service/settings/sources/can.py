"""A measuring device on a CAN bus, in the plant file."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, StringConstraints, ValidationInfo, model_validator

from service.settings.base import Identifier, MisfitError, Settings
from service.settings.toml_file import FOLDER

DBC_NAME = "[A-Za-z_][A-Za-z0-9_]{0,127}"

SignalPath = Annotated[str, StringConstraints(pattern=rf"^{DBC_NAME}\.{DBC_NAME}$")]
"""A signal of the DBC as "Message.Signal"."""

SampleSignals = SignalPath | Annotated[tuple[SignalPath, ...], Field(min_length=1, max_length=64)]
"""One signal, or one for each sample that a frame carries, the oldest first."""

OF_A_DBC = (
    "signals",
    "slow",
    "counters",
    "frame_samples",
    "epoch",
    "ok_bits",
    "seconds",
    "microseconds",
)
"""Keys that name signals, which a profile does by itself."""

LISTENING_IS_SET = ("socketcan",)
"""Interfaces whose bit rates are set in the system, not by who listens."""

WITHOUT_STAMPS = ("slcan",)
"""Interfaces that do not say when frames came."""


class CanSettings(Settings):
    """A measuring device on a CAN or CAN FD bus; padwatch only listens."""

    kind: Literal["can"]
    """This source's kind."""

    interface: Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
    """python-can's name of the interface; example: "socketcan", "slcan", "pcan", "kvaser"."""

    channel: Annotated[str, StringConstraints(min_length=1, max_length=255)]
    """What that interface calls a channel; example: "can0", "/dev/ttyACM0",
    "socket://192.0.2.17:4001", "PCAN_USBBUS1"."""

    bitrate: Annotated[int, Field(ge=5_000, le=1_000_000)] | None = None
    """Bits per second of the bus; not for socketcan, whose rate the system sets. Example: 500000.
    """

    fd: bool = False
    """Whether the bus carries CAN FD frames."""

    data_bitrate: Annotated[int, Field(ge=100_000, le=15_000_000)] | None = None
    """Bits per second of the data phase of CAN FD frames; example: 2000000."""

    options: dict[Identifier, str | int | float | bool] = Field(default={}, max_length=32)
    """Further arguments of python-can's interface, handed on as they are; example:
    { tty_baudrate = 2000000 }."""

    dbc: Annotated[str, StringConstraints(min_length=1, max_length=1000)] | None = None
    """DBC file that describes the frames, seen from the plant file's folder; example:
    "unit7.dbc"."""

    profile: Literal["padwatch_int16", "padwatch_float32"] | None = None
    """Instead of dbc and signals: the messages of padwatch's own simulated DAQ for this unit's
    channels, as counts or as engineering units."""

    signals: dict[Identifier, SampleSignals] = Field(default={}, max_length=32)
    """For each waveform channel its signal, "Message.Signal", or a list of them where a frame has
    several samples; example: { ujb_shaft_x = "WAVE_0.ujb_shaft_x" }."""

    slow: dict[Identifier, SignalPath] = Field(default={}, max_length=50)
    """For each slow channel its signal; example: { speed = "STATUS.speed" }."""

    counters: Annotated[tuple[SignalPath, ...], Field(max_length=128)] = ()
    """Counter signals, at most one for each message: all waveform messages have one, or none has.
    Without, frames are counted and losses are found by the clock alone."""

    counter_counts: Literal["samples", "frames"] = "samples"
    """Whether these counters count "samples" or "frames"."""

    frame_samples: Annotated[tuple[SignalPath, ...], Field(max_length=32)] = ()
    """Signals that say how many samples of a multi-sample frame are there, if it can be fewer."""

    epoch: SignalPath | None = None
    """Signal that changes when the device begins to count anew."""

    ok_bits: SignalPath | None = None
    """Signal whose bit c, the lowest first, is set while waveform channel c is healthy."""

    seconds: SignalPath | None = None
    """Signal with the UTC seconds since 1970 of the sample that its message belongs to."""

    microseconds: SignalPath | None = None
    """Signal with the microseconds to it; needed with seconds."""

    hold_samples: Annotated[int, Field(ge=1, le=1_000_000)] | SignalPath = 50
    """For how many samples, from the one its counter names, a message without waveforms is valid:
    a number, or the signal that says so."""

    hold_s: Annotated[float, Field(ge=0.01, le=3600.0)] = 5.0
    """For how many seconds a message without waveforms and without counter is valid."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 1.0
    """A bus without a complete new sample for this long counts as not connected; at least the time
    of three samples, or of three frames that have several."""

    stamps: Literal["host", "interface"] = "host"
    """What tells when frames came: the "host", which reads them, or the clock of the "interface",
    which is led to the host's; that one knows better where the host is busy at times."""

    receive_buffer: Annotated[int, Field(ge=100, le=10_000_000)] = 65_536
    """Frames that may wait to be worked on; example: 65536, half a minute of twelve channels."""

    when_full: Literal["drop", "wait"] = "drop"
    """What happens when that many wait: "drop" new frames and count them, or "wait", so that a
    device that can wait, as one that replays a recording, loses nothing."""

    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        self._folder = (info.context or {}).get(FOLDER, Path())
        if (self.dbc is None) == (self.profile is None):
            found = "neither" if self.dbc is None else "both"
            raise MisfitError(f"dbc or profile must be given, found {found}", "dbc")
        self._check_signals()
        self._check_speed()
        if self.stamps == "interface" and self.interface in WITHOUT_STAMPS:
            raise MisfitError(f'must be "host": {self.interface} has no time stamps', "stamps")
        return self

    @property
    def dbc_path(self) -> Path:
        """The DBC file, if there is one."""
        return self._folder / (self.dbc or "")

    def check_channels(self, channels: Iterable[str], slow_channels: Iterable[str]) -> None:
        """Refuse signals that do not fit a unit's channels, one to one.

        Raises `MisfitError` if a channel is unknown or has no signal.
        """
        if self.profile is not None:
            return
        for key, named, known in (
            ("signals", self.signals, list(channels)),
            ("slow", self.slow, list(slow_channels)),
        ):
            for id_ in named:
                if id_ not in known:
                    words = ", ".join(known) or "none"
                    raise MisfitError(f"no such channel; there are {words}", key, id_)
            missing = [id_ for id_ in known if id_ not in named]
            if missing:
                raise MisfitError(f"has no signal for {', '.join(missing)}", key)

    def _check_signals(self) -> None:
        if self.profile is not None:
            for key in OF_A_DBC:
                if getattr(self, key):
                    raise MisfitError("is for a dbc; the profile knows its own", key)
        elif not self.signals:
            raise MisfitError("must name a signal for each waveform channel", "signals")
        if (self.seconds is None) != (self.microseconds is None):
            key = "microseconds" if self.microseconds is None else "seconds"
            raise MisfitError("seconds and microseconds must be given together", key)
        if self.frame_samples and self.counter_counts == "frames":
            raise MisfitError('frame_samples needs "samples"', "counter_counts")

    def _check_speed(self) -> None:
        if self.data_bitrate is not None and not self.fd:
            raise MisfitError("is for CAN FD; set fd = true, or leave it out", "data_bitrate")
        if self.interface in LISTENING_IS_SET:
            for key in ("bitrate", "data_bitrate"):
                if getattr(self, key) is not None:
                    raise MisfitError(
                        "is set by the system here: ip link set can0 type can bitrate …", key
                    )
