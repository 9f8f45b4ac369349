"""Messages of the simulated CAN DAQ, their DBC file, and the settings of a source for them.

A block begins with messages of its sample index, epoch, health, time and slow values, each with a
counter that refers to the first sample of the block. The waveform messages follow.
"""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from can.util import CAN_FD_DLC

from acquisition.can.settings import CanChannel, CanLinkSettings, CanSettings, CanSlowChannel
from acquisition.errors import ConfigError

_FD_SAMPLES = 5
_FD_WAVE_HEAD, _FD_HEAD, _CLASSIC_HEAD = 4, 24, 2
_MAX_CHANNELS = 32
_MAX_SLOW = 50


class Kind(Enum):
    """Data type of a signal; the value is the NumPy type code."""

    U8 = "u1"
    U16 = "u2"
    U32 = "u4"
    I16 = "i2"
    F32 = "f4"

    @property
    def n_bytes(self) -> int:
        """Size of the signal in bytes."""
        return int(self.value[1])


@dataclass(frozen=True)
class Field:
    """Signal of a CAN message, `offset` bytes after its start; one count is `factor` in `unit`."""

    name: str
    offset: int
    kind: Kind
    unit: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class MessageShape:
    """CAN message of the simulated DAQ; `length` is in bytes.

    `first_channel` is the index of the first channel of a waveform message; None for other
    messages.
    """

    name: str
    frame_id: int
    extended: bool
    fd: bool
    length: int
    fields: tuple[Field, ...]
    first_channel: int | None = None

    @property
    def dtype(self) -> np.dtype[np.void]:
        """NumPy record type of the message: little-endian in classic CAN, big-endian in CAN FD."""
        order = ">" if self.fd else "<"
        return np.dtype(
            {
                "names": [field.name for field in self.fields],
                "formats": [order + field.kind.value for field in self.fields],
                "offsets": [field.offset for field in self.fields],
                "itemsize": self.length,
            }
        )

    def records(self, n_frames: int) -> npt.NDArray[np.void]:
        """Return records of `n_frames` frames, (n_frames,), filled with zeros."""
        return np.zeros(n_frames, dtype=self.dtype)


@dataclass(frozen=True)
class DaqSignal:
    """Channel of the simulated DAQ in the DBC file.

    One count is `factor` in the unit `unit`; `factor` is 1 for float32 samples.
    """

    id: str
    unit: str
    factor: float = 1.0


@dataclass(frozen=True, kw_only=True)
class CanShape:
    """Channels and message format of the simulated CAN DAQ.

    Parameters
    ----------
    fd, extended
        Whether the frames are CAN FD frames, and whether their ids have 29 bits.
    floats
        Whether samples are float32 in engineering units rather than int16 counts.
    base_id
        Id of the first message; further messages have consecutive ids.

    Raises
    ------
    ConfigError
        If the number of channels or the ids are out of range.
    """

    channels: tuple[DaqSignal, ...]
    slow: tuple[DaqSignal, ...] = ()
    fd: bool = False
    floats: bool = False
    base_id: int = 0x100
    extended: bool = False

    def __post_init__(self) -> None:
        if not 1 <= len(self.channels) <= _MAX_CHANNELS or len(self.slow) > _MAX_SLOW:
            raise ConfigError(
                f"simulated CAN DAQ: expected 1 to {_MAX_CHANNELS} channels and up to {_MAX_SLOW}"
                f" slow channels, got {len(self.channels)} and {len(self.slow)}"
            )
        highest = (1 << 29) - 1 if self.extended else (1 << 11) - 1
        if not 0 <= self.base_id <= highest - len(self.messages) + 1:
            raise ConfigError(
                f"simulated CAN DAQ: base_id must be 0 to {highest - len(self.messages) + 1}"
                f" for {len(self.messages)} messages, got {self.base_id}"
            )

    @property
    def samples_per_frame(self) -> int:
        """Number of samples per channel in a waveform frame."""
        return _FD_SAMPLES if self.fd else 1

    @property
    def messages(self) -> tuple[MessageShape, ...]:
        """All messages of a block in transmission order."""
        shapes = [*(self._fd_heads() if self.fd else self._classic_heads()), *self._waves()]
        return tuple(
            MessageShape(
                name=name,
                frame_id=self.base_id + n,
                extended=self.extended,
                fd=self.fd,
                length=_wire_length(fields, self.fd),
                fields=tuple(fields),
                first_channel=first,
            )
            for n, (name, fields, first) in enumerate(shapes)
        )

    @property
    def waves(self) -> tuple[MessageShape, ...]:
        """Waveform messages, which carry samples, in transmission order."""
        return tuple(m for m in self.messages if m.first_channel is not None)

    def _classic_heads(self) -> "list[_Shape]":
        heads: list[_Shape] = [
            ("HEAD", [Field("index", 0, Kind.U32), Field("epoch", 4, Kind.U32)], None),
            ("HEALTH", [_COUNTER, Field("n_samples", 2, Kind.U16), Field("ok", 4, Kind.U32)], None),
            ("TIME_S", [_COUNTER, Field("seconds", 2, Kind.U32)], None),
            ("TIME_US", [_COUNTER, Field("microseconds", 2, Kind.U32)], None),
        ]
        for number, slow in enumerate(self.slow):
            field = Field(dbc_name(slow.id), _CLASSIC_HEAD, Kind.F32, slow.unit)
            heads.append((f"SLOW_{number}", [_COUNTER, field], None))
        return heads

    def _fd_heads(self) -> "list[_Shape]":
        names = ("index", "epoch", "ok", "seconds", "microseconds")
        head = [Field(name, 4 * n, Kind.U32) for n, name in enumerate(names)]
        head.append(Field("n_samples", 20, Kind.U16))
        n_first = (64 - _FD_HEAD) // 4
        head += _floats(self.slow[:n_first], _FD_HEAD)
        heads: list[_Shape] = [("HEAD", head, None)]
        rest = self.slow[n_first:]
        for number in range(0, len(rest), 15):
            fields = [Field("index", 0, Kind.U32), *_floats(rest[number : number + 15], 4)]
            heads.append((f"SLOW_{number // 15}", fields, None))
        return heads

    def _waves(self) -> "list[_Shape]":
        kind = Kind.F32 if self.floats else Kind.I16
        head_bytes = _FD_WAVE_HEAD if self.fd else _CLASSIC_HEAD
        n_values = ((64 if self.fd else 8) - head_bytes) // kind.n_bytes
        step = n_values // self.samples_per_frame
        waves: list[_Shape] = []
        for first in range(0, len(self.channels), step):
            fields = [_COUNTER, Field("valid", 2, Kind.U8)] if self.fd else [_COUNTER]
            offset = head_bytes
            for channel in self.channels[first : first + step]:
                for name in self.sample_names(channel.id):
                    fields.append(Field(name, offset, kind, channel.unit, channel.factor))
                    offset += kind.n_bytes
            waves.append((f"WAVE_{first // step}", fields, first))
        return waves

    def sample_names(self, channel_id: str) -> tuple[str, ...]:
        """Return the signal names of a channel, one for each sample in a frame."""
        name = dbc_name(channel_id)
        if self.samples_per_frame == 1:
            return (name,)
        return tuple(f"{name}_{n}" for n in range(self.samples_per_frame))


_Shape = tuple[str, list[Field], int | None]
_COUNTER = Field("counter", 0, Kind.U16)


def dbc_name(channel_id: str) -> str:
    """Return a channel id as a valid DBC name: letters, digits and underscores, no digit first."""
    name = "".join(c if c.isalnum() and c.isascii() else "_" for c in channel_id)
    return f"_{name}" if name[0].isdigit() else name


def _floats(slow: tuple[DaqSignal, ...], offset: int) -> list[Field]:
    return [Field(dbc_name(s.id), offset + 4 * n, Kind.F32, s.unit) for n, s in enumerate(slow)]


def _wire_length(fields: list[Field], fd: bool) -> int:
    end = max(field.offset + field.kind.n_bytes for field in fields)
    return next(n for n in CAN_FD_DLC if n >= max(end, 8)) if fd else end


_NODE = "DAQ"
_NAME = "the simulated CAN DAQ's own DBC"
_CLASSIC_FORMAT, _FD_FORMAT = 0, 14
_HEADER = f"""VERSION ""

NS_ :

BS_:

BU_: {_NODE}
"""
_ATTRIBUTES = """
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","reserved","reserved",\
"reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved",\
"reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
"""


def daq_dbc(shape: CanShape) -> str:
    """Return the text of the DBC file of the simulated DAQ."""
    parts = [_HEADER]
    parts += [_message(message) for message in shape.messages]
    parts.append(_ATTRIBUTES)
    for message in shape.messages:
        number = (_FD_FORMAT if message.fd else _CLASSIC_FORMAT) + message.extended
        parts.append(f'BA_ "VFrameFormat" BO_ {_dbc_id(message)} {number};\n')
    for message in shape.messages:
        for field in message.fields:
            if field.kind is Kind.F32:
                parts.append(f"SIG_VALTYPE_ {_dbc_id(message)} {field.name} : 1;\n")
    return "".join(parts)


def daq_settings(
    shape: CanShape, link: CanLinkSettings, units: tuple[str, ...], **others: Any
) -> CanSettings:
    """Return the settings of a CAN source for the simulated DAQ, with the DBC file as text.

    Parameters
    ----------
    units
        Engineering unit of each waveform channel.
    others
        Additional fields of `CanSettings`.
    """
    where = {field.name: m.name for m in shape.messages for field in m.fields}
    return CanSettings(
        link=link,
        dbc=Path(_NAME),
        dbc_text=daq_dbc(shape),
        channels=tuple(
            CanChannel(c.id, unit, tuple(f"{where[n]}.{n}" for n in shape.sample_names(c.id)))
            for c, unit in zip(shape.channels, units, strict=True)
        ),
        slow=tuple(
            CanSlowChannel(s.id, s.unit, f"{where[dbc_name(s.id)]}.{dbc_name(s.id)}")
            for s in shape.slow
        ),
        **_beside(shape),
        **others,
    )


def _beside(shape: CanShape) -> dict[str, Any]:
    """Return the fields of `CanSettings` for counters and other signals that are not channels."""
    where = {field.name: m.name for m in shape.messages for field in m.fields}
    counters = [
        f"{message.name}.{field.name}"
        for message in shape.messages
        for field in message.fields
        if field.name in ("counter", "index")
    ]
    return {
        "counters": tuple(counters),
        "frame_samples": tuple(f"{m.name}.valid" for m in shape.waves) if shape.fd else (),
        "epoch": "HEAD.epoch",
        "ok_bits": f"{where['ok']}.ok",
        "seconds": f"{where['seconds']}.seconds",
        "microseconds": f"{where['microseconds']}.microseconds",
        "hold_samples": f"{where['n_samples']}.n_samples",
    }


def _message(message: MessageShape) -> str:
    lines = [f"\nBO_ {_dbc_id(message)} {message.name}: {message.length} {_NODE}\n"]
    lines += [_signal(field, message.fd) for field in message.fields]
    return "".join(lines)


def _signal(field: Field, motorola: bool) -> str:
    start = 8 * field.offset + (7 if motorola else 0)
    sign = "-" if field.kind in (Kind.I16, Kind.F32) else "+"
    place = f"{start}|{8 * field.kind.n_bytes}@{0 if motorola else 1}{sign}"
    return f' SG_ {field.name} : {place} ({field.factor!r},0) [0|0] "{field.unit}" {_NODE}\n'


def _dbc_id(message: MessageShape) -> int:
    return message.frame_id | (1 << 31 if message.extended else 0)
