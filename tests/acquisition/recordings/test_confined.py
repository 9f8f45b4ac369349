"""What a process of its own reads: it may crash, and it takes little memory."""

import errno
import hashlib
import io
import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acquisition.errors import ConfigError
from acquisition.recordings import reading
from acquisition.recordings.child import answer
from acquisition.recordings.confined import ConfinedProcess
from acquisition.recordings.imports.times import library
from acquisition.recordings.manifest import RecordedUnit, checksum_of
from acquisition.recordings.messages import receive
from acquisition.recordings.reader import open_recording
from acquisition.recordings.writer import RecordingWriter
from core.samples.blocks import Rejection, SampleBlock

Numbered = Callable[..., SampleBlock]

CONFINED = """
import resource
from acquisition.recordings.confined import confine

resource.setrlimit(resource.RLIMIT_AS, ({given}, {given}))
confine(2**31)
print(*(resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)))
"""


@pytest.mark.parametrize(("given", "memory"), [(2**33, 2**31), (2**30, 2**30)])
def test_limits_are_never_raised(given, memory):
    script = CONFINED.format(given=given)
    command = [sys.executable, "-c", script]
    found = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.split() == [str(memory), "1000000"]


def test_a_library_that_is_not_installed_is_named_with_how_to_get_it():
    with pytest.raises(
        ConfigError,
        match=r"^importing XYZ requires absent_one; run pip install 'padwatch\[imports\]'$",
    ):
        library("absent_one", "XYZ")


@pytest.mark.parametrize(
    ("number", "cause"),
    [("SIGKILL", InterruptedError), ("SIGTERM", InterruptedError), ("SIGSEGV", EOFError)],
)
def test_a_child_that_the_system_has_ended_is_no_fault_of_the_recording(
    record, numbered, tmp_path, monkeypatch, number, cause
):
    recording = open_recording(record([numbered(0, 50)]))
    (tmp_path / "ended.py").write_text(f"import os, signal; os.kill(os.getpid(), signal.{number})")
    monkeypatch.syspath_prepend(tmp_path)
    ended, failed = partial(ConfinedProcess, "ended"), "process cannot be started: .*"
    for name, replaced, message, reason in (
        ("_idle_or_new", ended, "recording: the reading process was ended by ", cause),
        ("ConfinedProcess", lambda *_, **__: ended(), failed, OSError),
    ):
        reading.close_idle_children()
        with monkeypatch.context() as patch:
            patch.setattr(reading, name, replaced)
            with pytest.raises(ConfigError, match=message + number) as it:
                list(recording.heads())
        assert isinstance(it.value.__cause__, reason)
    assert len(list(recording.heads())) == 1


CRASHES = """
import os, select, signal
select.select([0], [], [])
os.kill(os.getpid(), signal.SIGSEGV)
"""


def test_a_crash_with_the_request_unread_is_a_refusal_too(record, numbered, tmp_path, monkeypatch):
    """The parent's next read is then a reset of the connection, no end of the stream."""
    recording = open_recording(record([numbered(0, 50)]))
    (tmp_path / "crashes.py").write_text(CRASHES)
    monkeypatch.syspath_prepend(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(reading, "_idle_or_new", partial(ConfinedProcess, "crashes"))
        words = "recording: cannot be read as recording: the reading process was ended by SIGSEGV"
        with pytest.raises(ConfigError, match=words) as error:
            list(recording.heads())
    assert isinstance(error.value.__cause__, EOFError)  # of the file, not of the system
    assert len(list(recording.heads())) == 1


def test_what_is_not_read_to_its_end_is_never_taken_for_the_next(record, numbered):
    recording = open_recording(record([numbered(50 * n, 50) for n in range(600)]))
    blocks = recording.blocks()
    assert next(blocks).first_index == 0
    blocks.close()
    found = [cell.first_index for block in recording.blocks(500) for cell in block.cells()]
    assert found == list(range(25_000, 30_000, 50))


def test_an_error_of_the_disk_keeps_its_number(record, numbered, monkeypatch):
    fails = Mock(side_effect=OSError(errno.EIO, "Input/output error"))
    recording = open_recording(record([numbered(0, 50)]))
    monkeypatch.setattr(pq, "ParquetFile", fails)
    request = {"manifest": recording.manifest.model_dump(mode="json"), "first": 0, "stop": 1}
    out = io.BytesIO()
    answer({"path": str(recording.folder), "format": "recording", "samples": True} | request, out)
    out.seek(0)
    assert receive(out)[0]["errno"] == errno.EIO


READ = """
import resource, sys
from pathlib import Path
from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.reading import close_idle_children

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024

def read(folder):
    try:
        return sum(block.n_samples for block in open_recording(Path(folder)).blocks())
    except ConfigError as error:
        return error

for folder in sys.argv[1:]:
    before = peak()
    said = read(folder)
    print(peak() - before, said)
close_idle_children()
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)
"""
"""Reads recordings; prints for each how many MB the own peak grew, and what was said.

At the end it prints the peak of the child in MB.
"""

ROWS = 131_072


def varint(number: int) -> bytes:
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def page_header(kind: int, n_unpacked: int, n_packed: int, n_values: int) -> bytes:
    """As Parquet has it, with PLAIN values; kind 0 is data, 2 a dictionary."""
    sizes = b"".join(b"\x15" + varint(2 * n) for n in (kind, n_unpacked, n_packed))
    values = b"\x15" + varint(2 * n_values) + b"\x15\x00"
    return sizes + (
        b"\x2c" + values + b"\x15\x06\x15\x06\x00\x00"
        if kind == 0
        else b"\x4c" + values + b"\x00\x00"
    )


@pytest.fixture(scope="module")
def sound(tmp_path_factory, unit: RecordedUnit, numbered: Numbered) -> Path:
    """A row group of counts that hardly pack, so that there is room for a page of another's."""
    folder = tmp_path_factory.mktemp("bombs") / "sound"
    noise = np.random.default_rng(1).integers(-32768, 32767, (2, ROWS), np.int16)
    with RecordingWriter(folder, unit, "a test") as writer:
        for start in range(0, ROWS, 50):
            counts = noise[:, start : start + 50]
            writer.write(numbered(start, counts.shape[1], counts=counts))
    return folder


def with_content(sound: Path, number: int, name: str, content: bytes) -> Path:
    """A copy of the recording with one file changed, and sealed as if nothing were wrong."""
    folder = sound.with_name(f"hostile {number}")
    folder.mkdir()
    manifest = json.loads((sound / "manifest.json").read_text())
    for file in ("samples.parquet", "blocks.parquet"):
        data = content if file == name else (sound / file).read_bytes()
        (folder / file).write_bytes(data)
        manifest["files"][file] = {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    manifest["checksum"] = checksum_of(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def first_page_replaced(sound: Path, kind: int, n_unpacked: int, n_values: int) -> bytes:
    """One page for the whole first column: it says that it unpacks to so much, and does."""
    content = bytearray((sound / "samples.parquet").read_bytes())
    column = pq.read_metadata(sound / "samples.parquet").row_group(0).column(0)
    chunk = 4 + column.total_compressed_size
    packed = pa.Codec("zstd").compress(bytes(n_unpacked), asbytes=True)
    header = page_header(kind, n_unpacked, chunk - 4, n_values)
    header = page_header(kind, n_unpacked, chunk - 4 - len(header), n_values)
    rest = chunk - 4 - len(header) - len(packed) - 8
    assert rest > 0
    skipped = (0x184D2A50).to_bytes(4, "little") + rest.to_bytes(4, "little") + bytes(rest)
    content[4:chunk] = header + packed + skipped
    return bytes(content)


def text_repeated_from_a_dictionary(sound: Path) -> bytes:
    table = pq.read_table(sound / "blocks.parquet")
    rows = table.to_pylist()
    for row in rows:
        row["rejected"] = [{"reason": "x" * 1000, "n_samples": 1}] * 32
    path, changed = sound.with_name("many"), pa.Table.from_pylist(rows, schema=table.schema)
    pq.write_table(changed, path, compression="zstd", write_statistics=False)
    return path.read_bytes()


def footer_of_a_list(n_elements: int) -> bytes:
    footer = b"\x15\x02" + b"\x19\xfc" + varint(n_elements) + bytes(1000)
    return b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1"


HOSTILE: list[tuple[str, Callable[[Path], bytes], str]] = [
    *(
        (
            "samples.parquet",
            lambda sound, n=n_unpacked: first_page_replaced(sound, 0, n, ROWS),
            "requires more than 256 MiB of memory",
        )
        for n_unpacked in (300_000_000, 2**31 - 1)
    ),
    (
        "samples.parquet",
        lambda sound: first_page_replaced(sound, 2, 4000, 2**31 - 1),
        "requires more than 256 MiB of memory",
    ),
    ("blocks.parquet", text_repeated_from_a_dictionary, "a reason of 1 to 64 characters"),
    *(
        ("samples.parquet", lambda _, n=n_elements: footer_of_a_list(n), "Couldn't deserialize")
        for n_elements in (900_000, 2**31 - 1)
    ),
]


@pytest.fixture(scope="module")
def rejecting(sound: Path, unit: RecordedUnit, numbered: Numbered) -> Path:
    """As many rejections as can be."""
    rejected = tuple(Rejection(f"{n:02d}" + "ü" * 62, 1) for n in range(32))
    with RecordingWriter(sound.with_name("rejecting"), unit, "a test") as writer:
        for n in range(1000):
            writer.write(numbered(40 * n + 32, 1, rejected=rejected))
    return sound.with_name("rejecting")


def test_recordings_are_read_or_refused_in_little_memory(sound, rejecting):
    """The hostile ones are read in one process, which refuses them one by one."""
    hostile = [with_content(sound, n, name, of(sound)) for n, (name, of, _) in enumerate(HOSTILE)]
    command = [sys.executable, "-c", READ, *map(str, (sound, *hostile, rejecting))]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.stderr == ""
    *lines, child_mb = result.stdout.splitlines()
    first, *refused, last = [line.partition(" ") for line in lines]
    assert first[2] == str(ROWS)
    for (name, _, words), (grown_mb, _, said) in zip(HOSTILE, refused, strict=True):
        assert words in said, (name, words)
        assert int(grown_mb) < 20, words
    assert last[2] == "1000"
    assert int(last[0]) < 100
    assert int(child_mb) < 500
