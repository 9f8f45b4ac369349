"""Settings of a CAN or CAN FD source."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, StringConstraints, ValidationInfo, model_validator

from service.settings.base import Identifier, MisfitError, Settings
from service.settings.toml_file import FOLDER

DBC_NAME = "[A-Za-z_][A-Za-z0-9_]{0,127}"

SignalPath = Annotated[str, StringConstraints(pattern=rf"^{DBC_NAME}\.{DBC_NAME}$")]
"""Signal of the DBC file, written as "Message.Signal"."""

SampleSignals = SignalPath | Annotated[tuple[SignalPath, ...], Field(min_length=1, max_length=64)]
"""Signal of a channel, or one signal for each sample in a frame, the oldest sample first."""

OF_A_DBC = (
    *("signals", "slow", "counters", "frame_samples", "epoch", "ok_bits"),
    *("seconds", "microseconds"),
)
"""Keys that refer to signals of a DBC file; not allowed with a profile."""

LISTENING_IS_SET = ("socketcan",)
"""Interfaces of python-can whose bit rates are set in the operating system."""

WITHOUT_STAMPS = ("slcan",)
"""Interfaces of python-can without time stamps of frames."""


class CanSettings(Settings):
    """Settings of a measuring device on a CAN or CAN FD bus; padwatch only listens."""

    kind: Literal["can"]
    """Kind of the source, always "can"."""

    interface: Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
    """Name of the interface in python-can; example: "socketcan", "slcan", "pcan", "kvaser"."""

    channel: Annotated[str, StringConstraints(min_length=1, max_length=255)]
    """Channel of the interface; example: "can0", "/dev/ttyACM0", "socket://192.0.2.17:4001",
    "PCAN_USBBUS1"."""

    bitrate: Annotated[int, Field(ge=5_000, le=1_000_000)] | None = None
    """Bit rate of the bus, bit/s; not for socketcan, whose bit rate is set in the operating system.
    Example: 500000."""

    fd: bool = False
    """Whether the bus carries CAN FD frames."""

    data_bitrate: Annotated[int, Field(ge=100_000, le=15_000_000)] | None = None
    """Bit rate of the data phase of CAN FD frames, bit/s; example: 2000000."""

    options: dict[Identifier, str | int | float | bool] = Field(default={}, max_length=32)
    """Additional arguments of the python-can interface; example: { tty_baudrate = 2000000 }."""

    dbc: Annotated[str, StringConstraints(min_length=1, max_length=1000)] | None = None
    """DBC file of the frames, relative to the folder of the plant file; example: "unit7.dbc"."""

    profile: Literal["padwatch_int16", "padwatch_float32"] | None = None
    """Message set of padwatch's simulated DAQ, instead of dbc and signals: samples as counts
    ("padwatch_int16") or in engineering units ("padwatch_float32")."""

    signals: dict[Identifier, SampleSignals] = Field(default={}, max_length=32)
    """Signal of each waveform channel, "Message.Signal", or a list of signals if a frame has
    several samples; example: { ujb_shaft_x = "WAVE_0.ujb_shaft_x" }."""

    slow: dict[Identifier, SignalPath] = Field(default={}, max_length=50)
    """Signal of each slow channel; example: { speed = "STATUS.speed" }."""

    counters: Annotated[tuple[SignalPath, ...], Field(max_length=128)] = ()
    """Counter signals, at most one for each message; either all waveform messages have a counter or
    none has. Without counters, frames are counted and losses are detected by the clock."""

    counter_counts: Literal["samples", "frames"] = "samples"
    """Unit of the counters: "samples" or "frames"."""

    frame_samples: Annotated[tuple[SignalPath, ...], Field(max_length=32)] = ()
    """Signals with the number of samples in a frame, for messages in which the number varies."""

    epoch: SignalPath | None = None
    """Signal that changes when the device restarts its counters."""

    ok_bits: SignalPath | None = None
    """Signal whose bit c, counted from the least significant bit, is set while waveform channel c
    is healthy."""

    seconds: SignalPath | None = None
    """Signal with the sample time as whole seconds since 1970, UTC."""

    microseconds: SignalPath | None = None
    """Signal with the microseconds of the sample time; required with seconds."""

    hold_samples: Annotated[int, Field(ge=1, le=1_000_000)] | SignalPath = 50
    """Number of samples for which a message without waveforms is valid, from the sample of its
    counter: a constant, or the signal with the number."""

    hold_s: Annotated[float, Field(ge=0.01, le=3600.0)] = 5.0
    """Time for which a message without waveforms and without counter is valid, s."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 1.0
    """Time without a complete new sample after which the bus counts as not connected, s; at least
    three samples, or three frames with several samples."""

    stamps: Literal["host", "interface"] = "host"
    """Clock of the time stamps: the clock of the "host", or the clock of the "interface",
    synchronized with the host, which is more accurate if the host is busy."""

    receive_buffer: Annotated[int, Field(ge=100, le=10_000_000)] = 65_536
    """Maximum number of frames that wait for decoding; example: 65536, half a minute of 12
    channels."""

    when_full: Literal["drop", "wait"] = "drop"
    """Action when the buffer is full: "drop" and count new frames, or "wait", for a device that can
    be delayed, such as the replay of a recording."""

    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        self._folder = (info.context or {}).get(FOLDER, Path())
        if (self.dbc is None) == (self.profile is None):
            found = "neither" if self.dbc is None else "both"
            raise MisfitError(f"exactly one of dbc and profile must be given, found {found}", "dbc")
        self._check_signals()
        self._check_speed()
        if self.stamps == "interface" and self.interface in WITHOUT_STAMPS:
            raise MisfitError(f'must be "host": {self.interface} sends no time stamps', "stamps")
        return self

    @property
    def dbc_path(self) -> Path:
        """Path of the DBC file; without `dbc`, the folder of the plant file."""
        return self._folder / (self.dbc or "")

    def check_channels(self, channels: Iterable[str], slow_channels: Iterable[str]) -> None:
        """Check that signals and channels of the unit correspond one to one.

        With a profile nothing is checked. Raises `MisfitError` if a channel is unknown or has no
        signal.
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
                    raise MisfitError(f"unknown channel; known channels: {words}", key, id_)
            missing = [id_ for id_ in known if id_ not in named]
            if missing:
                words = f"names no signal for {', '.join(missing)}; add a signal for each"
                raise MisfitError(words, key)

    def _check_signals(self) -> None:
        if self.profile is not None:
            for key in OF_A_DBC:
                if getattr(self, key):
                    raise MisfitError("applies only with dbc, not with profile; remove it", key)
        elif not self.signals:
            raise MisfitError("must name a signal for each waveform channel", "signals")
        if (self.seconds is None) != (self.microseconds is None):
            key = "microseconds" if self.microseconds is None else "seconds"
            raise MisfitError("seconds and microseconds must be given together", key)
        if self.frame_samples and self.counter_counts == "frames":
            raise MisfitError('must be "samples" with frame_samples', "counter_counts")

    def _check_speed(self) -> None:
        if self.data_bitrate is not None and not self.fd:
            raise MisfitError("requires CAN FD; set fd = true", "data_bitrate")
        if self.interface in LISTENING_IS_SET:
            words = "bitrate N dbitrate N fd on" if self.fd else "bitrate N"
            for key in ("bitrate", "data_bitrate"):
                if getattr(self, key) is not None:
                    raise MisfitError(
                        f"must be set by the system: ip link set {self.channel} type can {words}",
                        key,
                    )
