"""Frames come back from candump and BLF logs as they were on the bus."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob, TimeAxis
from acquisition.recordings.messages import Frames
from acquisition.recordings.reading import imported_frames

START_S = 1_767_225_600
WRITERS = {"candump": can.CanutilsLogWriter, "blf": can.BLFWriter}


@pytest.fixture
def log_job(job: ImportJob) -> Callable[..., ImportJob]:
    def of(kind: str, utc_offset_s: int = 0) -> ImportJob:
        return replace(job, format=kind, time=TimeAxis("file", utc_offset_s), channels=(), slow=())

    return of


def messages(n: int = 20_000) -> list[can.Message]:
    """Classic and FD, short and long ids, with a remote request on the way."""
    made = []
    for k in range(n):
        is_fd, is_long = k % 3 == 0, k % 5 == 0
        made.append(
            can.Message(
                timestamp=START_S + k * 1666 / 1e6,
                arbitration_id=(0x18FF0000 if is_long else 0x100) + k % 64,
                is_extended_id=is_long,
                is_fd=is_fd,
                data=(k.to_bytes(4, "big") * 16)[: 64 if is_fd else k % 9],
            )
        )
    made[7] = can.Message(
        timestamp=made[7].timestamp, arbitration_id=1, is_remote_frame=True, dlc=2
    )
    return made


def all_frames(path: Path, job: ImportJob) -> list[Frames]:
    return [batch for batch, _ in imported_frames(path, job)]


@pytest.mark.parametrize("kind", WRITERS)
def test_data_frames_come_back_with_time_to_a_microsecond(tmp_path, log_job, kind):
    sent = messages()
    with WRITERS[kind](tmp_path / "log") as log:
        for message in sent:
            log(message)
    found = all_frames(tmp_path / "log", log_job(kind))
    sent = [message for message in sent if not message.is_remote_frame]
    assert len(found) == 3
    columns = ("id", "extended", "fd", "length", "data", "time_ns")
    ids, extended, fd, lengths, data, times_ns = (
        np.concatenate([batch[name] for batch in found]) for name in columns
    )
    np.testing.assert_array_equal(ids, [m.arbitration_id for m in sent])
    np.testing.assert_array_equal(extended, [m.is_extended_id for m in sent])
    np.testing.assert_array_equal(fd, [m.is_fd for m in sent])
    np.testing.assert_array_equal(lengths, [len(m.data) for m in sent])
    assert data.tobytes() == b"".join(bytes(m.data).ljust(64, b"\0") for m in sent)
    due_us = START_S * 10**6 + 1666 * np.delete(np.arange(20_000), 7)
    assert np.abs(times_ns // 1000 - due_us).max() <= 1


def test_a_blf_log_is_in_the_zone_of_the_mapping(tmp_path, log_job):
    with can.BLFWriter(tmp_path / "log") as log:
        log(messages(8)[0])
    (batch,) = all_frames(tmp_path / "log", log_job("blf", utc_offset_s=-10_800))
    assert batch["time_ns"].tolist() == [(START_S + 10_800) * 10**9]


@pytest.mark.parametrize(("kind", "buses"), [("candump", ("can0", "can1")), ("blf", ("1", "2"))])
def test_like_frames_of_two_buses_are_never_mixed(tmp_path, log_job, kind, buses):
    with WRITERS[kind](tmp_path / "log") as log:
        for n in range(100):
            channel = f"can{n % 2}" if kind == "candump" else n % 2
            log(can.Message(timestamp=1e9 + n, arbitration_id=1, data=bytes([n]), channel=channel))
    job = log_job(kind)
    words = f'"{buses[0]}" and of bus "{buses[1]}"; select one, such as bus = "{buses[0]}"'
    with pytest.raises(ConfigError, match=words):
        all_frames(tmp_path / "log", job)
    for n, bus in enumerate(buses):
        (batch,) = all_frames(tmp_path / "log", replace(job, bus=bus))
        assert batch["data"][:, 0].tolist() == list(range(n, 100, 2))
    with pytest.raises(ConfigError, match='has no frame of bus "9"; its bus is'):
        all_frames(tmp_path / "log", replace(job, bus="9"))


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["(1.0) can0 12345678901#00"], "line 1: .* is not a candump frame"),
        (["(1.0) can0 123#00", "(1.0) can0 FFFFFFFF#00"], "line 2: .* is not a candump frame"),
        (["(1.0) can0 800#00"], "frame 1: id 0x800, length 1 and 1 bytes of data are not"),
        (["(1.0) can0 123#000102030405060708"], "9 bytes of data are not a valid CAN frame"),
        (["(1.0) can0 123##1" + "00" * 63], "63 bytes of data are not a valid CAN frame"),
        (["(1.0) can0 123#0"], "line 1: .* is not a candump frame"),
        (["(nan) can0 123#00"], "line 1: .* is not a candump frame"),
        (["(999999999999.0) can0 123#00"], "is not a valid time"),
        (["(1.0) can0 123#00" * 1000], "line 1: .* is not a candump frame"),
        (["\x00\x01\x02"], "line 1: .* is not a candump frame"),
        (["(1.0) can0 123#" + "zz"], "line 1: .* is not a candump frame"),
    ],
)
def test_frames_that_were_on_no_bus_are_refused(tmp_path, log_job, lines, words):
    path = tmp_path / "log"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ConfigError, match=words) as error:
        all_frames(path, log_job("candump"))
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
