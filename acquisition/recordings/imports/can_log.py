"""Reader of CAN logs in candump and BLF format, by python-can, in batches of frames."""

import logging
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import can
import numpy as np
from can.io.blf import BLFParseError
from can.util import CAN_FD_DLC

from acquisition.errors import ConfigError
from acquisition.recordings.imports.csv_file import CUT_OFF
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.messages import FRAME, MAX_DATA, Frames

_BATCH = 8192
_CANDUMP_LINE = re.compile(
    r"\(\d{1,12}\.\d{1,9}\) \S{1,64} "
    r"(?:(?P<error>[23][0-9A-Fa-f]{7})|[0-9A-Fa-f]{3}|[01][0-9A-Fa-f]{7})#"
    r"(?:R[0-9]?|(?:#[0-9])?(?:[0-9A-Fa-f]{2})*)(?: [RT])?\s*"
)
"""Pattern of a candump line; python-can misreads identifiers over 29 bits and error frames."""


def read_frames(path: Path, job: ImportJob) -> Iterator[tuple[Frames, float]]:
    """Yield batches of data frames of a log, each with the fraction of the log read so far.

    candump writes UTC seconds since 1970. BLF contains the local time of its writer; the time zone
    is that of the import job.

    Raises ConfigError if a frame is invalid, the log is incomplete, or the log has frames of
    several buses and the job selects none.
    """
    size = max(path.stat().st_size, 1)
    with path.open("rb") as stream:
        frames = _of_one_bus(_data_frames(stream, job), job)
        while batch := list(islice(frames, _BATCH)):
            done = 1.0 if stream.closed else min(stream.tell() / size, 1.0)  # python-can closes it
            yield _batch(batch, job), done


def _data_frames(stream: BinaryIO, job: ImportJob) -> Iterator[can.Message]:
    lines: Any = _candump_lines(stream)
    frames = can.CanutilsLogReader(lines) if job.format == "candump" else _blf_frames(stream)
    for number, frame in enumerate(frames, start=1):
        _require_possible(frame, number)
        if not (frame.is_error_frame or frame.is_remote_frame):
            yield frame


def _candump_lines(stream: BinaryIO) -> Iterator[str]:
    """Yield the lines that contain a frame, except error frames."""
    for number, content in enumerate(iter(stream.readline, b""), start=1):
        line = content.decode("ascii", "replace")
        if not line.endswith("\n"):
            raise ConfigError(f"line {number}: {CUT_OFF}")
        match = _CANDUMP_LINE.fullmatch(line)
        if match is None and line.strip():
            raise ConfigError(f"line {number}: {line[:60]!r} is not a candump frame")
        if match is not None and match["error"] is None:
            yield line


def _blf_frames(stream: BinaryIO) -> Iterator[can.Message]:
    """Yield all frames, including error frames; raise ConfigError for data python-can skips."""
    size = stream.seek(0, 2)
    stream.seek(0)
    warnings = logging.getLogger("can.io.blf")
    warnings.disabled = False
    warnings.setLevel(logging.WARNING)
    warnings.addHandler(_Refusal())
    reader = _CountingBlfReader(stream)
    if reader.file_size != size:
        raise ConfigError(
            f"the file has {size} bytes, but {reader.file_size} according to its header; it is"
            " truncated or unfinished"
        )
    try:
        yield from reader
    except BLFParseError as error:
        raise ConfigError(f"the file is damaged: {error or 'invalid object'}") from error
    reader.require_all()


class _Refusal(logging.Handler):
    """Log handler that raises ConfigError for warnings of python-can about skipped objects."""

    def emit(self, record: logging.LogRecord) -> None:
        raise ConfigError(record.getMessage())


class _CountingBlfReader(can.BLFReader):
    """BLF reader that counts objects; python-can does not detect a truncated log."""

    n_objects = 0

    def require_all(self) -> None:
        if self._tail.strip(b"\0"):
            raise ConfigError("the file is truncated: it ends within an object")
        if self.n_objects < self.object_count:
            n_expected = self.object_count
            raise ConfigError(f"truncated file: {self.n_objects} objects, expected {n_expected}")

    def _parse_container(self, data: bytes) -> Iterator[can.Message]:
        known, at = self._tail + data, -1
        for frame in super()._parse_container(data):
            if self._pos == at:  # python-can would loop endlessly
                raise ConfigError("the file is damaged: an object has length 0")
            at = self._pos
            yield frame
        self.n_objects += known.count(b"LOBJ", 0, len(known) - len(self._tail))


def _of_one_bus(frames: Iterator[can.Message], job: ImportJob) -> Iterator[can.Message]:
    """Yield the frames of a single bus; the same identifier on two buses means two devices."""
    bus, other, n_taken = job.bus, "", 0
    for frame in frames:
        # candump names buses; BLF numbers them from 1, python-can from 0
        is_counted = job.format == "blf" and isinstance(frame.channel, int)
        found = str(frame.channel + 1 if is_counted else frame.channel)  # type: ignore[operator]
        bus = bus or found
        if found == bus:
            n_taken += 1
            yield frame
        elif not job.bus:
            raise ConfigError(
                f'the log has frames of bus "{bus}" and of bus "{found}"; select one, such as'
                f' bus = "{bus}"'
            )
        other = found
    if other and not n_taken:
        raise ConfigError(f'the log has no frame of bus "{bus}"; its bus is "{other}"')


def _require_possible(frame: can.Message, number: int) -> None:
    n_bytes = len(frame.data)
    limit = MAX_DATA if frame.is_fd else 8
    id_limit = 2**29 if frame.is_extended_id else 2**11
    is_sound = n_bytes <= limit and n_bytes in CAN_FD_DLC and 0 <= frame.arbitration_id < id_limit
    if not is_sound or (not frame.is_remote_frame and frame.dlc != n_bytes):
        raise ConfigError(
            f"frame {number}: id {frame.arbitration_id:#x}, length {frame.dlc} and {n_bytes} bytes"
            " of data are not a valid CAN frame"
        )
    if not abs(frame.timestamp) < 2**33:  # NaN, too
        raise ConfigError(f"frame {number}: {frame.timestamp} s is not a valid time")


def _batch(frames: list[can.Message], job: ImportJob) -> Frames:
    found = np.zeros(len(frames), FRAME)
    # the resolution of a double of seconds since 1970 is a quarter of a microsecond
    us = np.rint(np.array([frame.timestamp for frame in frames]) * 1e6).astype(np.int64)
    offset_s = job.time.utc_offset_s if job.format == "blf" else 0
    found["time_ns"] = us * 1000 - offset_s * 1_000_000_000
    found["id"] = [frame.arbitration_id for frame in frames]
    found["extended"] = [frame.is_extended_id for frame in frames]
    found["fd"] = [frame.is_fd for frame in frames]
    found["length"] = [len(frame.data) for frame in frames]
    for row, frame in zip(found["data"], frames, strict=True):
        row[: len(frame.data)] = np.frombuffer(frame.data, np.uint8)
    return found
