"""CAN logs of candump and BLF, in batches of frames."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.frames import MAX_DATA, FrameBatch
from acquisition.recordings.imports.blf import frames_of_blf
from acquisition.recordings.imports.candump import frames_of_candump
from acquisition.recordings.imports.job import ImportJob

_BATCH = 8192
_LENGTHS = {*range(9), 12, 16, 20, 24, 32, 48, 64}
"""That a CAN FD frame can have; a classic one up to 8."""


def read_frames(path: Path, job: ImportJob) -> Iterator[tuple[FrameBatch, float]]:
    """Data frames of a log and the share of it that has been read.

    candump writes seconds since 1970 in UTC. BLF has the clock of whoever recorded it: its time
    zone is that of the mapping.

    Raises
    ------
    ConfigError
        If a frame cannot have been on a bus, or frames were on several and it is not said which.
    """
    size = max(path.stat().st_size, 1)
    with path.open("rb") as stream:
        waiting: list[Any] = []
        for frame in _of_one_bus(_data_frames(stream, job), job.bus):
            waiting.append(frame)
            if len(waiting) == _BATCH:
                yield _batch(waiting, job), min(stream.tell() / size, 1.0)
                waiting = []
        if waiting:
            yield _batch(waiting, job), 1.0


def _data_frames(stream: BinaryIO, job: ImportJob) -> Iterator[Any]:
    for number, frame in enumerate(_frames(stream, job)):
        _require_possible(frame, number + 1)
        if not (frame.is_error_frame or frame.is_remote_frame):
            yield frame


def _of_one_bus(frames: Iterator[Any], wanted: str) -> Iterator[Any]:
    """Frames of the same id on two buses come from two devices."""
    bus, other, n_taken = wanted, "", 0
    for frame in frames:
        found = _bus(frame)
        bus = bus or found
        if found == bus:
            n_taken += 1
            yield frame
        elif wanted:
            other = found
        else:
            raise ConfigError(
                f'has frames of bus "{bus}" and of bus "{found}": say by bus = "{bus}" which is'
                " meant"
            )
    if other and not n_taken:
        raise ConfigError(f'has no frame of bus "{wanted}", but of bus "{other}"')


def _bus(frame: Any) -> str:
    """As a log has it: candump names buses, BLF counts them from 1."""
    return frame.channel if isinstance(frame.channel, str) else str((frame.channel or 0) + 1)


def _frames(stream: BinaryIO, job: ImportJob) -> Iterator[Any]:
    return frames_of_candump(stream) if job.format == "candump" else frames_of_blf(stream)


def _require_possible(frame: Any, number: int) -> None:
    n_bytes = len(frame.data)
    limit = MAX_DATA if frame.is_fd else 8
    id_limit = 2**29 if frame.is_extended_id else 2**11
    is_sound = n_bytes <= limit and n_bytes in _LENGTHS and 0 <= frame.arbitration_id < id_limit
    if not is_sound or (not frame.is_remote_frame and frame.dlc != n_bytes):
        raise ConfigError(
            f"frame {number}: id {frame.arbitration_id:#x}, length {frame.dlc}, {n_bytes} bytes of"
            " data cannot have been on a bus"
        )
    if not abs(frame.timestamp) < 2**33:  # NaN, too
        raise ConfigError(f"frame {number}: {frame.timestamp} s is no time")


def _batch(frames: list[Any], job: ImportJob) -> FrameBatch:
    data = np.zeros((len(frames), MAX_DATA), np.uint8)
    for row, frame in zip(data, frames, strict=True):
        row[: len(frame.data)] = np.frombuffer(frame.data, np.uint8)
    # a double of seconds since 1970 is good to a fourth of a microsecond
    us = np.rint(np.array([frame.timestamp for frame in frames]) * 1e6).astype(np.int64)
    offset_s = job.time.utc_offset_s if job.format == "blf" else 0
    return FrameBatch(
        times_ns=us * 1000 - offset_s * 1_000_000_000,
        ids=np.array([frame.arbitration_id for frame in frames], np.uint32),
        extended=np.array([frame.is_extended_id for frame in frames], np.bool_),
        fd=np.array([frame.is_fd for frame in frames], np.bool_),
        lengths=np.array([len(frame.data) for frame in frames], np.uint8),
        data=data,
    )
