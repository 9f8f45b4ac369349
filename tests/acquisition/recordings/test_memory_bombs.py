"""Small files that would unpack to gigabytes are refused by the limits of the confined child."""

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

from acquisition.delivery.blocks import RawBlock
from acquisition.recordings.manifest import RecordedUnit, checksum_of
from acquisition.recordings.writer import RecordingWriter
from core.samples.blocks import Rejection

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
        return sum(block.n_samples for block in open_recording(Path(folder)).raw_blocks())
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


Numbered = Callable[..., RawBlock]


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
        (
            "samples.parquet",
            lambda _, n=n_elements: footer_of_a_list(n),
            "Couldn't deserialize thrift",
        )
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


def test_recordings_are_read_or_refused_in_little_memory(sound: Path, rejecting: Path) -> None:
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
