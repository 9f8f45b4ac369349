"""A DBC file as plain values; the one module that uses cantools."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from can.util import CAN_FD_DLC
from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error as DatabaseError

from acquisition.delivery.small_file import read_small_file
from acquisition.errors import ConfigError, FrameError

MAX_FILE_BYTES = 8_000_000
MAX_REASON = 500
"""Characters of a parser's message that are shown."""

_MAX_CLASSIC_BYTES = 8
_EXTENDED_FLAG = 1 << 31
_MAX_MULTIPLEXER_VALUES = 100_000
_MULTIPLEXER_LINE = re.compile(r"SG_MUL_VAL_[^;]*")
_RANGE = re.compile(r"(\d{1,20})\s*-\s*(\d{1,20})")


@dataclass(frozen=True)
class DbcSignal:
    """A signal and where it lies in its message.

    Parameters
    ----------
    start
        Bit number as in the DBC: of the lowest bit in Intel order, of the highest in Motorola.
    multiplexer_ids
        Values of the message's multiplexer at which the signal is there; empty if always.
    """

    message: "DbcMessage"
    name: str
    start: int
    n_bits: int
    big_endian: bool
    signed: bool
    is_float: bool
    scale: float
    offset: float
    unit: str
    multiplexer_ids: tuple[int, ...]

    @property
    def path(self) -> str:
        """Message.Signal, as the plant file names it."""
        return f"{self.message.name}.{self.name}"


@dataclass(frozen=True)
class DbcMessage:
    """A message; `key` identifies its frames, and standard and extended ids never share one.

    Parameters
    ----------
    length
        Bytes that a frame of it has on the wire.
    multiplexer
        Name of its multiplexer signal, if it has one.
    nested
        Whether a multiplexer of it is itself multiplexed, or it has several.
    """

    name: str
    frame_id: int
    extended: bool
    fd: bool
    length: int
    multiplexer: str | None
    nested: bool
    source: Message = field(repr=False, compare=False)
    signals: dict[str, DbcSignal] = field(default_factory=dict, repr=False, compare=False)

    @property
    def key(self) -> int:
        """Identifies its frames: the id, and whether it is extended."""
        return frame_key(self.frame_id, self.extended)

    def raw_value(self, name: str, data: bytes) -> int | float:
        """Decode one signal of one frame, whatever its shape; not scaled.

        Raises
        ------
        FrameError
            If cantools cannot decode the frame.
        """
        try:
            values = self.source.decode(data, decode_choices=False, scaling=False)
        except (DatabaseError, ValueError) as exc:
            raise FrameError(f"{self.name}: {exc}") from exc
        if not isinstance(values, Mapping) or name not in values:
            raise FrameError(f"{self.name}: the frame has no signal {name}")
        value = values[name]
        if not isinstance(value, int | float):
            raise FrameError(f"{self.name}.{name}: {value!r} is not a number")
        return value


def frame_key(frame_id: int, extended: bool) -> int:
    """One number for id and kind of id."""
    return frame_id | _EXTENDED_FLAG if extended else frame_id


def load_dbc(path: Path) -> dict[str, DbcMessage]:
    """Read a DBC file; see `parse_dbc`."""
    return parse_dbc(_text(path), path)


def parse_dbc(text: str, path: Path) -> dict[str, DbcMessage]:
    """Read the text of a DBC file.

    Returns
    -------
    dict
        Messages by name.

    Raises
    ------
    ConfigError
        If the file cannot be read, is no DBC, has overlapping signals, or two messages with one id.
    """
    _refuse_wide_ranges(text, path)
    try:
        database = load_string(text, database_format="dbc")
    except (DatabaseError, ValueError, KeyError) as exc:
        reason = str(exc)[:MAX_REASON]  # cantools repeats a line, which may be the whole file
        raise ConfigError(f"{path}: not a DBC file that can be used: {reason}") from exc
    if not isinstance(database, Database) or not database.messages:
        raise ConfigError(f"{path}: no message in it; a DBC has lines that begin with BO_")
    messages = [_message(message) for message in database.messages]
    _refuse_shared(path, messages)
    return {message.name: message for message in messages}


def _text(path: Path) -> str:
    try:
        content = read_small_file(path, MAX_FILE_BYTES)
    except OSError as exc:
        raise ConfigError(f"{path}: {exc.strerror}; dbc must name a DBC file") from exc
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # what most DBC editors write


def _refuse_wide_ranges(text: str, path: Path) -> None:
    """Refuse ranges that cantools would write out number by number until the memory is full."""
    n_values = sum(
        max(0, int(last) - int(first))
        for line in _MULTIPLEXER_LINE.findall(text)
        for first, last in _RANGE.findall(line)
    )
    if n_values > _MAX_MULTIPLEXER_VALUES:
        raise ConfigError(
            f"{path}: ranges of SG_MUL_VAL_ have {n_values} values, at most"
            f" {_MAX_MULTIPLEXER_VALUES} are allowed; leave out those that no frame has"
        )


def _refuse_shared(path: Path, messages: Iterable[DbcMessage]) -> None:
    names: dict[int, str] = {}
    seen: set[str] = set()
    for message in messages:
        if message.key in names:
            kind = "extended" if message.extended else "standard"
            raise ConfigError(
                f"{path}: messages {names[message.key]} and {message.name} share the {kind} id"
                f" {message.frame_id} ({message.frame_id:#x}); give each its own"
            )
        if message.name in seen:
            raise ConfigError(f"{path}: two messages are called {message.name}; rename one")
        names[message.key] = message.name
        seen.add(message.name)


def _message(source: Message) -> DbcMessage:
    multiplexers = [s.name for s in source.signals if s.is_multiplexer]
    roots = [s.name for s in source.signals if s.is_multiplexer and not s.multiplexer_ids]
    message = DbcMessage(
        name=source.name,
        frame_id=source.frame_id,
        extended=source.is_extended_frame,
        fd=bool(source.is_fd) or source.length > _MAX_CLASSIC_BYTES,
        length=next((n for n in CAN_FD_DLC if n >= source.length), source.length),
        multiplexer=roots[0] if roots else None,
        nested=len(multiplexers) > 1,
        source=source,
    )
    for signal in source.signals:
        message.signals[signal.name] = _signal(message, signal)
    return message


def _signal(message: DbcMessage, source: Signal) -> DbcSignal:
    return DbcSignal(
        message=message,
        name=source.name,
        start=source.start,
        n_bits=source.length,
        big_endian=source.byte_order == "big_endian",
        signed=source.is_signed,
        is_float=source.is_float,
        scale=float(source.scale),
        offset=float(source.offset),
        unit=source.unit or "",
        multiplexer_ids=tuple(source.multiplexer_ids or ()),
    )
