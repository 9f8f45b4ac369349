"""Lines of ``candump -L``, strictly; python-can's reader takes an impossible id for another one."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from acquisition.errors import ConfigError

CUT_OFF = "the file ends within it; if it is whole, put an end to its last line"

_MAX_LINE = 400
_LINE = re.compile(
    rb"\((?P<time>\d{1,12}\.\d{1,9})\) (?P<bus>\S{1,64}) (?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?:(?P<remote>R[0-9A-Fa-f]?)|(?P<fd>#[0-9A-Fa-f])?(?P<data>(?:[0-9A-Fa-f]{2})*))"
    rb"(?: [RT])?\s*"
)
_ERROR_FLAG = 0x20000000


@dataclass
class LoggedFrame:
    """A frame with the names that python-can has for its parts, and as changeable."""

    timestamp: float
    arbitration_id: int
    is_extended_id: bool
    is_fd: bool
    is_remote_frame: bool
    is_error_frame: bool
    dlc: int
    data: bytearray
    channel: str | int | None = None


def frames_of_candump(stream: BinaryIO) -> Iterator[LoggedFrame]:
    """All frames of a log.

    Raises
    ------
    ConfigError
        If a line is none of candump's; the message has its number.
    """
    number = 0
    while line := stream.readline(_MAX_LINE + 1):
        number += 1
        if not line.endswith(b"\n") and len(line) <= _MAX_LINE:
            raise ConfigError(f"line {number}: {CUT_OFF}")
        if not line.strip():
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise ConfigError(
                f"line {number}: {line[:60].decode('ascii', 'replace')!r} is no frame"
            )
        yield _frame(match)


def _frame(match: re.Match[bytes]) -> LoggedFrame:
    id_ = int(match["id"], 16)
    data = bytearray.fromhex((match["data"] or b"").decode())
    return LoggedFrame(
        timestamp=float(match["time"]),
        arbitration_id=id_ & ~_ERROR_FLAG,
        is_extended_id=len(match["id"]) == 8,
        is_fd=match["fd"] is not None,
        is_remote_frame=match["remote"] is not None,
        is_error_frame=bool(id_ & _ERROR_FLAG),
        dlc=len(data),
        data=data,
        channel=match["bus"].decode("ascii", "replace"),
    )
