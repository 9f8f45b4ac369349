"""A folder that is no sound recording ends in one clear sentence."""

import hashlib
import json
import os
import random
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rigs.tiers import first_fast

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import checksum_of
from acquisition.recordings.reader import open_recording
from core.samples.blocks import SampleBlock

Record = Callable[[Iterable[SampleBlock]], Path]
N_BLOCKS, N_EACH = 20, 50


@pytest.fixture
def folder(record: Record, numbered: Callable[..., SampleBlock]) -> Path:
    return record([numbered(N_EACH * n, N_EACH) for n in range(N_BLOCKS)])


def change_manifest(folder: Path, **changes: Any) -> None:
    path = folder / "manifest.json"
    document = json.loads(path.read_text()) | changes
    path.write_text(json.dumps(document | {"checksum": checksum_of(document)}))


def reseal(folder: Path) -> None:
    """Make sizes and checksums right again, as whoever means harm would."""
    files = {}
    for name in ("samples.parquet", "blocks.parquet"):
        content = (folder / name).read_bytes()
        files[name] = {"size": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    change_manifest(folder, files=files)


def rewrite(folder: Path, name: str, table: Any, **options: Any) -> None:
    pq.write_table(table, folder / name, **{"compression": "zstd"} | options)
    reseal(folder)


def read_to_the_end(folder: Path) -> int:
    return sum(block.counts.shape[1] for block in open_recording(folder).blocks())


def refusal(folder: Path) -> str:
    with pytest.raises(ConfigError) as error:
        read_to_the_end(folder)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(str(folder))
    return str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": 4}, "'padwatch-recording' version 4, expected"),
        ({"format": "wav"}, "'wav' version 3, expected 'padwatch-recording' version 3"),
        ({"version": "1"}, "version: Input should be a valid integer"),
        ({"unit": "../U1"}, "unit: String should match"),
        ({"rate_hz": 0.0}, "rate_hz: Input should be greater than 0"),
        ({"rate_hz": float("nan")}, "rate_hz: Input should be a finite number"),
        ({"sample_type": "int8"}, "sample_type: Input should be 'int16' or 'float32'"),
        (
            {"sample_type": "float32"},
            "column 'c0' (int16, not null), but the manifest requires 'c0' (float",
        ),
        ({"block_samples": 0}, "block_samples: Input should be greater than or equal to 1"),
        ({"channels": []}, "channels: Tuple should have at least 1 item"),
        ({"n_samples": 2**40}, "n_samples: Input should be less than or equal to 536870912"),
        ({"n_samples": 999}, "samples.parquet: file has 1000 rows, expected 999"),
        ({"n_blocks": 19}, "blocks.parquet: file has 20 rows, expected 19"),
        ({"surprise": 1}, "surprise: Extra inputs are not permitted"),
        ({"files": {}}, "files: Dictionary should have at least 2 items"),
    ],
    ids=str,
)
def test_a_manifest_that_says_something_else_is_refused(folder, changes, words):
    change_manifest(folder, **changes)
    assert words in refusal(folder)


@pytest.mark.parametrize("place", range(50, 1000, 67))
def test_a_manifest_in_which_one_character_is_another_is_refused(folder, place):
    path = folder / "manifest.json"
    text = bytearray(path.read_bytes())
    while not chr(text[place]).isalnum():  # a space more or less says nothing else
        place += 1
    text[place] ^= 1
    path.write_bytes(text)
    assert refusal(folder)


def test_a_manifest_that_lost_its_checksum_is_refused(folder):
    path = folder / "manifest.json"
    for checksum in (None, "0" * 64):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"checksum": checksum}))
        assert "checksum does not match" in refusal(folder)


def test_a_manifest_cannot_lead_out_of_its_folder(folder):
    files = json.loads((folder / "manifest.json").read_text())["files"]
    files["../../secret"] = files.pop("samples.parquet")
    change_manifest(folder, files=files)
    assert "files.../../secret.[key]: Input should be 'samples.parquet'" in refusal(folder)


def test_a_file_that_leads_elsewhere_or_waits_for_ever_is_refused(folder):
    samples = folder / "samples.parquet"
    samples.rename(folder / "elsewhere")
    samples.symlink_to(folder / "elsewhere")
    assert "samples.parquet: not a regular file" in refusal(folder)
    samples.unlink()
    os.mkfifo(samples)
    assert "samples.parquet: not a regular file" in refusal(folder)
    samples.unlink()
    assert "samples.parquet: No such file or directory" in refusal(folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "Invalid JSON"),
        (b"[" * 100_000, "Invalid JSON"),
        (b"\xff\xfe", "Invalid JSON"),
        (b"[]", "Input should be an object"),
        (b"{" + b" " * 1_000_001, "larger than 1000000 bytes"),
        (b'{"format": "padwatch-recording", "version": 3}', "Field required"),
    ],
    ids=range(6),
)
def test_a_manifest_that_is_none_is_refused(folder, text, words):
    (folder / "manifest.json").write_bytes(text)
    assert words in refusal(folder)


def test_a_folder_that_is_none_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="absent: folder does not exist"):
        open_recording(tmp_path / "absent")
    with pytest.raises(ConfigError, match=r"manifest\.json is missing; not a recording"):
        open_recording(tmp_path)


@pytest.mark.parametrize("name", ["samples.parquet", "blocks.parquet"])
def test_a_truncated_or_damaged_file_is_refused(folder, name):
    content = (folder / name).read_bytes()
    (folder / name).write_bytes(content[:-100])
    says = f"{name}: file has {len(content) - 100} bytes, expected {len(content)}"
    assert says in refusal(folder)
    reseal(folder)
    assert f"{name}: Parquet magic bytes not found in footer" in refusal(folder)
    (folder / name).write_bytes(content[:100] + bytes([content[100] ^ 1]) + content[101:])
    change_manifest(
        folder,
        files=json.loads((folder / "manifest.json").read_text())["files"]
        | {name: {"size": len(content), "sha256": hashlib.sha256(content).hexdigest()}},
    )
    assert f"{name}: file is damaged: its checksum" in refusal(folder)


DOUBLES = pa.field("c1", pa.float64(), nullable=False), [np.zeros(1000)]
HOLES = "c1", [pa.nulls(1000, pa.int16())]


@pytest.mark.parametrize(
    ("changed", "options", "words"),
    [
        (lambda t: t.set_column(1, *DOUBLES), {}, "column 'c1' (double, not null), but the"),
        (lambda t: t.set_column(1, *HOLES), {}, "column 'c1' (int16), but the"),
        (lambda t: t.append_column("c9", t["c0"]), {}, "columns, but the manifest requires"),
        (lambda t: t, {"row_group_size": 500}, "samples.parquet: row groups must have"),
    ],
)
def test_samples_that_are_not_as_the_format_has_them_are_refused(folder, changed, options, words):
    table = pq.read_table(folder / "samples.parquet")
    rewrite(folder, "samples.parquet", changed(table), **options)
    assert words in refusal(folder)


def test_a_footer_of_80_mb_is_refused_in_little_memory(folder):
    """A footer of that size can take a gigabyte when parsed."""
    footer = 80_000_000
    with (folder / "samples.parquet").open("wb") as file:
        file.truncate(footer)
        file.seek(footer)
        file.write(footer.to_bytes(4, "little") + b"PAR1")
    reseal(folder)
    before = psutil.Process().memory_info().rss
    assert "samples.parquet: Couldn't deserialize thrift" in refusal(folder)
    assert psutil.Process().memory_info().rss - before < 20_000_000


def change_block(folder: Path, number: int, **changes: Any) -> None:
    table = pq.read_table(folder / "blocks.parquet")
    rows = table.to_pylist()
    rows[number] |= changes
    rewrite(folder, "blocks.parquet", pa.Table.from_pylist(rows, schema=table.schema))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n_samples": 51}, "1001 samples in all blocks, but 1000 in the manifest"),
        ({"n_samples": 0}, "block 3: n_samples must be 1 to"),
        ({"n_samples": -50}, "to 131072, got -50"),
        ({"n_samples": 2**31 - 1}, "to 131072, got 2147483647"),
        ({"first_index": -1}, "block 3: first_index must be"),
        ({"first_index": 2**62}, "9007199254740992, got 4611686018427387904"),
        ({"epoch": -7}, "block 3: epoch must be 0 to"),
        ({"ok": 7}, "block 3: ok must be 0 to 3, got 7"),
        ({"rejected": [{"reason": "torn", "n_samples": 10}]}, "block 3: 10 rejected, but 0"),
        ({"rejected": [{"reason": "x", "n_samples": 0}]}, "a rejection must have at least 1"),
        (
            {"rejected": [{"reason": "x" * 10_000, "n_samples": 1}]},
            "a reason of 1 to 64 characters, got 1 and",
        ),
        ({"rejected": [{"reason": "x", "n_samples": 1}] * 100}, "block 3: 100 rejections, more"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_blocks_that_no_device_can_have_delivered_are_refused(folder, changes, words):
    change_block(folder, 3, **changes)
    assert words in refusal(folder)


@pytest.mark.parametrize("n_damaged", first_fast(1, [60, 300]))
@pytest.mark.parametrize("name", ["samples.parquet", "blocks.parquet"])
def test_any_damage_to_a_resealed_file_is_read_or_refused_without_a_crash(folder, name, n_damaged):
    """Bytes changed at random, with checksums made right."""
    content = (folder / name).read_bytes()
    chance = random.Random(4)  # noqa: S311  not a secret
    n_refused = 0
    for _ in range(n_damaged):
        damaged = bytearray(content)
        for _ in range(chance.randint(1, 4)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        (folder / name).write_bytes(damaged)
        reseal(folder)
        found = outcome(folder)
        if found != "1000 samples":
            n_refused += 1
            assert found.startswith(str(folder))
            assert "\n" not in found
    assert n_refused > n_damaged // 6


def outcome(folder: Path) -> str:
    try:
        return f"{read_to_the_end(folder)} samples"
    except ConfigError as error:
        return str(error)
