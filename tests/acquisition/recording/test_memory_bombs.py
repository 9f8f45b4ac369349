"""Small files that would unpack to gigabytes are refused before anything is unpacked."""

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acquisition.raw import RawBlock
from acquisition.recording.manifest import RecordedUnit, checksum_of
from acquisition.recording.writer import RecordingWriter
from core.blocks import Rejection

READ = """
import resource, sys
from pathlib import Path
from acquisition.errors import ConfigError
from acquisition.recording.reader import open_recording

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024

def read(folder):
    return sum(block.n_samples for block in open_recording(Path(folder)).raw_blocks())

read(sys.argv[1])
before = peak()
try:
    said = str(read(sys.argv[2]))
except ConfigError as error:
    said = str(error)
print(peak() - before, said)
"""
"""Reads a sound recording, then another; prints how many MB its peak grew, and what it said."""

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


@pytest.fixture
def sound(tmp_path: Path, unit: RecordedUnit, numbered: Callable[..., RawBlock]) -> Path:
    """A row group of counts that hardly pack, so that there is room for a page of another's."""
    noise = np.random.default_rng(1).integers(-32768, 32767, (2, ROWS), np.int16)
    with RecordingWriter(tmp_path / "sound", unit, "a test") as writer:
        for start in range(0, ROWS, 50):
            counts = noise[:, start : start + 50]
            writer.write(numbered(start, counts.shape[1], counts=counts))
    return tmp_path / "sound"


def with_content(sound: Path, name: str, content: bytes) -> Path:
    """A copy of the recording with one file changed, and sealed as if nothing were wrong."""
    folder = sound.with_name("hostile")
    folder.mkdir()
    manifest = json.loads((sound / "manifest.json").read_text())
    for file in ("samples.parquet", "blocks.parquet"):
        data = content if file == name else (sound / file).read_bytes()
        (folder / file).write_bytes(data)
        manifest["files"][file] = {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    manifest["checksum"] = checksum_of(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def read_in_a_process(sound: Path, hostile: Path) -> tuple[int, str]:
    command = [sys.executable, "-c", READ, str(sound), str(hostile)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.stderr == ""
    grown_mb, _, said = result.stdout.strip().partition(" ")
    return int(grown_mb), said


def test_reading_what_is_sound_takes_little(sound: Path) -> None:
    grown_mb, said = read_in_a_process(sound, sound)
    assert said == str(ROWS)
    assert grown_mb < 50


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


@pytest.mark.parametrize("n_unpacked", [2**31 - 1, 300_000_000])
def test_a_page_that_unpacks_to_gigabytes_is_refused_unread(sound: Path, n_unpacked: int) -> None:
    hostile = with_content(
        sound, "samples.parquet", first_page_replaced(sound, 0, n_unpacked, ROWS)
    )
    grown_mb, said = read_in_a_process(sound, hostile)
    assert f"samples.parquet: a column that unpacks to {n_unpacked} bytes, at most" in said
    assert grown_mb < 20


def test_a_dictionary_of_more_entries_than_bytes_is_refused(sound: Path) -> None:
    hostile = with_content(sound, "samples.parquet", first_page_replaced(sound, 2, 4000, 2**31 - 1))
    grown_mb, said = read_in_a_process(sound, hostile)
    assert "samples.parquet: 2147483647 entries in 4000 bytes of dictionary" in said
    assert grown_mb < 20


def test_a_long_text_repeated_from_a_dictionary_is_refused(sound: Path) -> None:
    table = pq.read_table(sound / "blocks.parquet")
    rows = table.to_pylist()
    for row in rows:
        row["rejected"] = [{"reason": "x" * 1000, "n_samples": 1}] * 32
    path = sound.with_name("many")
    pq.write_table(
        pa.Table.from_pylist(rows, schema=table.schema),
        path,
        compression="zstd",
        write_statistics=False,
    )
    hostile = with_content(sound, "blocks.parquet", path.read_bytes())
    grown_mb, said = read_in_a_process(sound, hostile)
    assert "blocks.parquet: 83904 texts out of a dictionary of 1004 bytes" in said
    assert grown_mb < 20


@pytest.mark.parametrize("n_elements", [900_000, 2**31 - 1])
def test_a_footer_whose_lists_cannot_be_that_long_is_refused(sound: Path, n_elements: int) -> None:
    footer = b"\x15\x02" + b"\x19\xfc" + varint(n_elements) + bytes(1000)
    content = b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1"
    grown_mb, said = read_in_a_process(sound, with_content(sound, "samples.parquet", content))
    assert f"samples.parquet: damaged: a list of {n_elements} elements in " in said
    assert grown_mb < 20


def test_as_many_rejections_as_can_be_are_read_in_little_memory(
    tmp_path: Path, unit: RecordedUnit, numbered: Callable[..., RawBlock], sound: Path
) -> None:
    rejected = tuple(Rejection(f"{n:02d}" + "ü" * 62, 1) for n in range(32))
    with RecordingWriter(tmp_path / "rejecting", unit, "a test") as writer:
        for n in range(1000):
            writer.write(numbered(40 * n + 32, 1, rejected=rejected))
    grown_mb, said = read_in_a_process(sound, tmp_path / "rejecting")
    assert said == "1000"
    assert grown_mb < 100
