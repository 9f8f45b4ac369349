"""What other tools get: engineering units with their unit, UTC, and gaps in sight."""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from acquisition.errors import ConfigError
from acquisition.recordings.export import ExportFormat, csv_schema, export_recording, export_tables
from acquisition.recordings.reader import Recording, open_recording
from core.samples.blocks import SampleBlock

Record = Callable[..., Path]
Numbered = Callable[..., SampleBlock]

INDEX = [*range(100), *range(137, 200), *range(40, 90)]
EPOCHS = [1] * 163 + [2] * 50
PER_COUNT = np.float32(12.0 / 32768 * -250.0)


@pytest.fixture
def recording(record: Record, numbered: Numbered) -> Recording:
    """A gap, a restart, a channel that is not OK for a block, and a slow value that comes later."""
    return open_recording(
        record(
            [
                numbered(0, 50),
                numbered(50, 50, ok=(True, False)),
                numbered(137, 13, slow=(46.0, 1.5)),
                numbered(150, 50, slow=(47.0, 2.5)),
                numbered(40, 50, epoch=2, start_ns=1_767_225_700_000_001_000),
            ]
        )
    )


@pytest.fixture
def expected() -> np.ndarray:
    """Of both channels."""
    samples = np.array([INDEX, np.array(INDEX) + 1]).astype(np.float32) * PER_COUNT
    samples[1, 50:100] = np.nan
    return samples


def test_csv_is_plain_text_with_units_in_its_headings(recording, expected, tmp_path):
    export_recording(recording, ExportFormat.CSV, tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == [
        "time_utc",
        "epoch",
        "index",
        "c0 [um]",
        "c1 [um]",
        "slow0 [degC]",
        "slow1 [degC]",
    ]
    assert rows[0][:3] == ["2026-01-01 00:00:00.000000Z", "1", "0"]
    assert rows[100][:3] == ["2026-01-01 00:00:00.228333Z", "1", "137"]
    assert rows[-1][:3] == ["2026-01-01 00:01:40.081667Z", "2", "89"]
    table = np.array([row[1:] for row in rows], dtype=np.float64).T
    np.testing.assert_array_equal(table[0], EPOCHS)
    np.testing.assert_array_equal(table[1], INDEX)
    np.testing.assert_array_equal(table[2:4].astype(np.float32), expected)
    np.testing.assert_array_equal(
        table[5], [math.nan] * 100 + [1.5] * 13 + [2.5] * 50 + [math.nan] * 50
    )


def test_parquet_has_units_in_its_metadata(recording, expected, tmp_path):
    export_recording(recording, ExportFormat.PARQUET, tmp_path / "run.parquet")
    table = pq.read_table(tmp_path / "run.parquet")
    assert str(table.schema.field("time_utc").type) == "timestamp[ns, tz=UTC]"
    assert table.schema.field("c0").metadata[b"unit"] == b"um"
    assert table.schema.field("slow0").metadata[b"unit"] == b"degC"
    np.testing.assert_array_equal([table["c0"], table["c1"]], expected)
    np.testing.assert_array_equal(table["index"], INDEX)


@pytest.mark.parametrize("kind", ExportFormat)
def test_a_recording_of_many_blocks_and_no_slow_channels_is_exported_whole(
    tmp_path, unit, record, numbered, kind
):
    plain = unit.model_copy(update={"slow_channels": ()})
    own = plain.calibration
    blocks = (numbered(7 * n, 7, slow=(), calibration=own) for n in range(1200))
    recording = open_recording(record(blocks, plain))
    told: list[int] = []
    export_recording(recording, kind, tmp_path / "out", told.append)
    assert sum(told) == 8400
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "recording"]


@pytest.mark.parametrize("kind", ExportFormat)
def test_a_slow_value_that_cannot_be_is_no_number_in_any_file(record, numbered, tmp_path, kind):
    recording = open_recording(record([numbered(0, 50, slow=(400.0, 45.0))]))
    export_recording(recording, kind, tmp_path / "run.out")
    (table,) = export_tables(recording, csv_schema(recording.manifest))
    np.testing.assert_array_equal(table.columns[-2:], [[math.nan] * 50, [45.0] * 50])
    content = (tmp_path / "run.out").read_bytes()
    assert b",400" not in content
    assert np.float64(400.0).tobytes() not in content


@pytest.mark.parametrize("id_", ["time_utc", "epoch", "index"])
@pytest.mark.parametrize("kind", ExportFormat)
@pytest.mark.parametrize("where", ["channels", "slow_channels"])
def test_a_channel_of_any_name_is_exported_or_refused_by_name(
    tmp_path, unit, record, numbered, kind, id_, where
):
    first, *rest = getattr(unit, where)
    named = unit.model_copy(update={where: (first.model_copy(update={"id": id_}), *rest)})
    recording = open_recording(record([numbered(0, 50)], named))
    try:
        export_recording(recording, kind, tmp_path / "run.out")
    except ConfigError as error:
        assert kind is not ExportFormat.CSV
        assert f"channel '{id_}' has a name that Parquet exports reserve" in str(error)  # noqa: PT017
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names in (["recording"], ["recording", "run.out"])


def test_nothing_is_overwritten_or_left_half_done(recording, tmp_path):
    (tmp_path / "there").write_text("precious")
    with pytest.raises(ConfigError, match="there: the file exists already"):
        export_recording(recording, ExportFormat.CSV, tmp_path / "there")
    assert (tmp_path / "there").read_text() == "precious"
    with pytest.raises(ConfigError, match=r"out: .*No such file"):
        export_recording(recording, ExportFormat.CSV, tmp_path / "absent" / "out")
    (recording.folder / "samples.parquet").write_bytes(b"PAR1")
    for kind in ExportFormat:
        with pytest.raises(ConfigError, match="file size is 4 bytes"):
            export_recording(recording, kind, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recording", "there"]
