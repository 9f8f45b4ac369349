"""Messages and signals of a DBC file; the only module that uses cantools."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from can.util import CAN_FD_DLC
from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error as DatabaseError

from acquisition.delivery.small_file import read_small_file
from acquisition.errors import ConfigError, FrameError

MAX_FILE_BYTES = 8_000_000
MAX_REASON = 500
"""Maximum number of characters of a parser message in an error."""

_MAX_CLASSIC_BYTES = 8
_EXTENDED_FLAG = 1 << 31
_MAX_MULTIPLEXER_VALUES = 100_000
_MULTIPLEXER_LINE = re.compile(r"SG_MUL_VAL_[^;]*")
_RANGE = re.compile(r"(\d{1,20})\s*-\s*(\d{1,20})")


@dataclass(frozen=True)
class DbcSignal:
    """Signal of a DBC message, as parsed by cantools."""

    message: "DbcMessage"
    source: Signal

    @property
    def path(self) -> str:
        """Name of the signal in the plant file: "Message.Signal"."""
        return f"{self.message.name}.{self.source.name}"

    @property
    def unit(self) -> str:
        """Unit of the signal in the DBC; empty if the DBC states none."""
        return self.source.unit or ""

    @property
    def multiplexer_ids(self) -> list[int]:
        """Multiplexer values at which the message contains the signal; empty if always."""
        return self.source.multiplexer_ids or []


class DbcMessage:
    """Message of a DBC file.

    Attributes
    ----------
    name, frame_id
        Name and frame id in the file.
    extended, fd
        Whether the frame id has 29 bits; whether frames are CAN FD.
    key
        Frame key of the message, see `frame_key`.
    signals
        All signals of the message by name.
    length
        Data length of the message's frames in bytes.
    multiplexer
        Signal that selects the multiplexed signals; None if the message is not multiplexed.
    nested
        Whether the message has more than one multiplexer signal; such messages are not supported.
    """

    def __init__(self, source: Message) -> None:
        self._source = source
        self.name, self.frame_id = source.name, source.frame_id
        self.extended = source.is_extended_frame
        self.key = frame_key(self.frame_id, self.extended)
        self.fd = bool(source.is_fd) or source.length > _MAX_CLASSIC_BYTES
        self.length = next((n for n in CAN_FD_DLC if n >= source.length), source.length)
        self.signals = {signal.name: DbcSignal(self, signal) for signal in source.signals}
        multiplexers = [s for s in self.signals.values() if s.source.is_multiplexer]
        self.nested = len(multiplexers) > 1
        self.multiplexer = next((s for s in multiplexers if not s.multiplexer_ids), None)

    def raw_value(self, name: str, data: bytes) -> int | float:
        """Return the unscaled value of a signal of any bit layout in one frame.

        Raises FrameError if cantools cannot decode the frame, or the frame does not contain the
        signal.
        """
        try:
            values: Any = self._source.decode(data, decode_choices=False, scaling=False)
            value: int | float = values[name]
        except (DatabaseError, ValueError, KeyError) as exc:
            raise FrameError(f"{self.name}.{name} cannot be decoded: {exc}") from exc
        return value


def frame_key(frame_id: int, extended: bool) -> int:
    """Return a key that is unique for a frame id and its kind (standard or extended)."""
    return frame_id | _EXTENDED_FLAG if extended else frame_id


def load_dbc(path: Path, text: str | None = None) -> dict[str, DbcMessage]:
    """Return the messages of a DBC file.

    Parameters
    ----------
    path
        Path of the file, also for error messages.
    text
        Content of the file; None to read the file.

    Returns
    -------
    dict
        Messages by name.

    Raises
    ------
    ConfigError
        If the file cannot be read, is no DBC, or has overlapping signals or duplicate messages.
    """
    text = _text(path) if text is None else text
    _refuse_wide_ranges(text, path)
    try:
        database = load_string(text, database_format="dbc")
    except (DatabaseError, ValueError, KeyError) as exc:
        reason = str(exc)[:MAX_REASON]  # cantools repeats a line, which may be the whole file
        raise ConfigError(f"{path}: invalid DBC file: {reason}") from exc
    if not isinstance(database, Database) or not database.messages:
        raise ConfigError(f"{path}: the DBC file defines no message (lines that begin with BO_)")
    by_name: dict[str, DbcMessage] = {}
    by_key: dict[int, DbcMessage] = {}
    for message in map(DbcMessage, database.messages):
        other = by_key.setdefault(message.key, message)
        if other is not message:
            kind = "extended" if message.extended else "standard"
            raise ConfigError(
                f"{path}: messages {other.name} and {message.name} share the {kind} id"
                f" {message.frame_id} ({message.frame_id:#x}); ids must be unique"
            )
        if by_name.setdefault(message.name, message) is not message:
            raise ConfigError(f"{path}: two messages have the name {message.name}; rename one")
    return by_name


def _text(path: Path) -> str:
    try:
        content = read_small_file(path, MAX_FILE_BYTES)
    except OSError as exc:
        raise ConfigError(f"{path}: {exc.strerror}; dbc must be the path of a DBC file") from exc
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # the encoding of most DBC editors


def _refuse_wide_ranges(text: str, path: Path) -> None:
    """Raise ConfigError for multiplexer ranges so large that cantools would exhaust the memory."""
    n_values = sum(
        max(0, int(last) - int(first))
        for line in _MULTIPLEXER_LINE.findall(text)
        for first, last in _RANGE.findall(line)
    )
    if n_values > _MAX_MULTIPLEXER_VALUES:
        raise ConfigError(
            f"{path}: the ranges of SG_MUL_VAL_ must have at most {_MAX_MULTIPLEXER_VALUES}"
            f" values, got {n_values}; remove values that no frame has"
        )
