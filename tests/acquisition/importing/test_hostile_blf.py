"""A BLF log that is damaged, or means harm, ends in one sentence; python-can would miss frames."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can
import pytest
from rigs.hostile_files import measured

from acquisition.errors import ConfigError
from acquisition.importing.job import ImportJob, TimeAxis
from acquisition.importing.reading import reading

HEADER = 144
OBJECT = struct.Struct("<4sHHLL")
CONTAINER = struct.Struct("<H6xL4x")


@pytest.fixture
def blf_job(job: ImportJob) -> ImportJob:
    return replace(job, format="blf", time=TimeAxis("file", 0), channels=(), slow=())


@pytest.fixture
def objects(tmp_path: Path) -> bytes:
    """A hundred frames, as they are in a container."""
    with can.BLFWriter(tmp_path / "sound", compression_level=0) as log:
        for n in range(100):
            log(can.Message(timestamp=1e9 + n, arbitration_id=1, data=bytes(8)))
    return (tmp_path / "sound").read_bytes()[HEADER + OBJECT.size + CONTAINER.size :]


def container(content: bytes, *, method: int = 0, n_bytes: int | None = None) -> bytes:
    size = OBJECT.size + CONTAINER.size + len(content)
    unpacked = len(content) if n_bytes is None else n_bytes
    head = OBJECT.pack(b"LOBJ", OBJECT.size, 1, size, 10) + CONTAINER.pack(method, unpacked)
    return head + content + bytes(size % 4)


def write(path: Path, content: bytes, n_objects: int = 100, n_bytes: int | None = None) -> None:
    size = HEADER + len(content) if n_bytes is None else n_bytes
    head = struct.pack("<4sL8xQQL", b"LOGG", HEADER, size, size, n_objects)
    path.write_bytes(head.ljust(HEADER, b"\0") + content)


def n_frames(path: Path, job: ImportJob) -> int:
    with reading(path, job) as found:
        return sum(len(batch.times_ns) for batch in found.frames())


def changed(objects: bytes, number: int, at: int, value: int) -> bytes:
    """One of the objects with another number in its head."""
    place = number * len(objects) // 100 + at
    return objects[:place] + struct.pack("<H", value) + objects[place + 2 :]


def test_objects_may_go_on_in_the_next_container(
    tmp_path: Path, blf_job: ImportJob, objects: bytes
) -> None:
    packed = zlib.compress(objects[1001:])
    both = container(objects[:1001]) + container(packed, method=2, n_bytes=len(objects) - 1001)
    write(tmp_path / "run", both)
    assert n_frames(tmp_path / "run", blf_job) == 100


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lambda o: container(changed(o, 50, 8, 0)), "an object that is none"),  # for ever
        (lambda o: container(changed(o, 50, 8, 60000)), "ends within an object"),
        (lambda o: container(changed(o, 50, 6, 3)), "has 100 frames, of which 99 can be read"),
        (lambda o: container(changed(o, 50, 12, 7)[: len(o) // 2]), "50 objects, the header says"),
        (lambda o: container(o[:-20]), "cut off: it ends within an object"),
        (lambda o: container(o[:96] + bytes(40) + o[96:]), "there is no object where one should"),
        (lambda o: container(zlib.compress(o), method=1), "packed by method 1"),
        (lambda o: container(zlib.compress(o)[:-9], method=2, n_bytes=len(o)), "is not of"),
        (lambda o: container(zlib.compress(o), method=2, n_bytes=len(o) - 1), "is not of"),
        (lambda _: container(b"\xff" * 99, method=2, n_bytes=9), "incorrect header check"),
        (lambda o: o, "a frame outside of any container"),
        (lambda _: OBJECT.pack(b"LOBJ", 16, 1, 20, 10) + bytes(4), "a container of 4 bytes"),
    ],
    ids=range(12),
)
def test_a_log_of_which_anything_is_missing_is_refused(
    tmp_path: Path,
    blf_job: ImportJob,
    objects: bytes,
    content: Callable[[bytes], bytes],
    words: str,
) -> None:
    write(tmp_path / "run", content(objects))
    with pytest.raises(ConfigError, match=words):
        n_frames(tmp_path / "run", blf_job)


def test_a_log_that_was_not_finished_is_refused(
    tmp_path: Path, blf_job: ImportJob, objects: bytes
) -> None:
    write(tmp_path / "run", container(objects), n_objects=0, n_bytes=HEADER)
    with pytest.raises(ConfigError, match=r"its header says 144: cut off, or whatever wrote it"):
        n_frames(tmp_path / "run", blf_job)


def test_a_container_that_unpacks_to_gigabytes_is_refused_in_little_memory(
    tmp_path: Path, blf_job: ImportJob
) -> None:
    packer = zlib.compressobj(1)
    block = packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = block + 255 * block[2:]  # without the head of the stream
    declared, packed_more = tmp_path / "declared", tmp_path / "packed"
    write(declared, container(packed, method=2, n_bytes=2**32 - 1))
    write(packed_more, container(packed, method=2, n_bytes=1000))
    own_mb, child_mb, said = measured(blf_job, declared, packed_more)
    assert "from 4294967295 bytes" in said[0]
    assert "is not of 1000 bytes" in said[1]
    assert max(own_mb, child_mb) < 250
