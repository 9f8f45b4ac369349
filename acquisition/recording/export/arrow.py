"""CSV and Parquet: a row for each sample."""

from io import RawIOBase
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from acquisition.recording.export.rows import UNITS, ExportRows, require_free_names
from acquisition.recording.manifest import Manifest

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


class CsvExporter:
    """Headings have the unit in brackets; none can be taken for a formula by a spreadsheet."""

    def __init__(self, path: Path | RawIOBase, manifest: Manifest) -> None:
        time = pa.field("time_utc", pa.timestamp("us", tz="UTC"))
        headings = [_harmless(f"{id_} [{unit}]") for id_, unit in _columns(manifest)]
        self._schema = _schema(manifest, time, headings)
        self._writer = pyarrow.csv.CSVWriter(path, self._schema)

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        self._writer.write_table(_table(rows, self._schema, rows.times_ns // 1000))

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


class ParquetExporter:
    """Columns have their unit in their metadata."""

    def __init__(self, path: Path, manifest: Manifest) -> None:
        time = pa.field("time_utc", pa.timestamp("ns", tz="UTC"))
        require_free_names([id_ for id_, _ in _columns(manifest)], ("time_utc", "epoch", "index"))
        schema = _schema(manifest, time, [id_ for id_, _ in _columns(manifest)])
        for id_, unit in _columns(manifest):
            at = schema.get_field_index(id_)
            schema = schema.set(at, schema.field(at).with_metadata({"unit": unit}))
        self._schema = schema.with_metadata({"unit": manifest.unit, "made_by": manifest.made_by})
        self._writer = pq.ParquetWriter(path, self._schema, compression="zstd")

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        self._writer.write_table(_table(rows, self._schema, rows.times_ns))

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


def _columns(manifest: Manifest) -> list[tuple[str, str]]:
    waveforms = [(c.id, UNITS[c.measurand]) for c in manifest.channels]
    return waveforms + [(c.id, c.unit) for c in manifest.slow_channels]


def _schema(manifest: Manifest, time: Any, names: list[str]) -> Any:
    n_waveforms = len(manifest.channels)
    values = [
        pa.field(name, pa.float32() if n < n_waveforms else pa.float64())
        for n, name in enumerate(names)
    ]
    return pa.schema([time, pa.field("epoch", pa.int64()), pa.field("index", pa.int64()), *values])


def _table(rows: ExportRows, schema: Any, times: Any) -> Any:
    columns = [times, rows.epochs, rows.index, *rows.samples, *rows.slow_of_rows]
    arrays = [pa.array(c, type=field.type) for c, field in zip(columns, schema, strict=True)]
    return pa.table(arrays, schema=schema)


def _harmless(heading: str) -> str:
    return f"'{heading}" if heading.startswith(_FORMULA_STARTS) else heading
