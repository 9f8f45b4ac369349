"""Export of recordings to CSV and Parquet: engineering units, UTC times, one row per sample."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from enum import StrEnum
from functools import partial
from io import RawIOBase
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from acquisition.delivery.units import UNIT_OF
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import Manifest
from acquisition.recordings.reader import Recording
from acquisition.recordings.tables import foreign_errors_of
from core.checks.channels import VERDICTS
from core.quality import Level
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S

_ROWS_AT_ONCE = 25_600
_OWN = ("time_utc", "epoch", "index")
_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


class ExportFormat(StrEnum):
    """File format of an export."""

    CSV = "csv"
    PARQUET = "parquet"


def export_recording(
    recording: Recording,
    kind: ExportFormat,
    out: Path,
    advanced: Callable[[int], None] = lambda _: None,
) -> None:
    """Export a recording to a file; a failed export leaves no file.

    Parameters
    ----------
    out
        Path of the file to create; it must not exist.
    advanced
        Progress callback; its argument is the number of rows written since its previous call.

    Raises
    ------
    ConfigError
        If the file exists or cannot be written, a channel has the name of a reserved column, or
        the recording cannot be read.
    """
    if os.path.lexists(out):
        raise ConfigError(f"{out}: the file exists already; choose another path")
    aside = out.with_name(out.name + ".incomplete")
    try:
        with foreign_errors_of(out):
            for n_rows in write_rows(recording, kind, aside):
                advanced(n_rows)
            aside.rename(out)
    finally:
        with suppress(FileNotFoundError):
            aside.unlink()


def write_rows(recording: Recording, kind: ExportFormat, sink: Path | RawIOBase) -> Iterator[int]:
    """Write a recording to a file or stream in steps; yield the number of rows of each step.

    Nothing is written without iteration. The file is complete once the last number, 0, is yielded.

    Raises ConfigError if a channel has the name of a reserved column, or a file of the recording is
    unreadable.
    """
    schema_of, open_writer = _FORMATS[kind]
    schema = schema_of(recording.manifest)
    with open_writer(sink, schema) as writer:
        for table in export_tables(recording, schema):
            writer.write_table(table)
            yield table.num_rows
    yield 0  # the writer is closed: the footer is written


def export_tables(recording: Recording, schema: Any) -> Iterator[Any]:
    """Yield the rows of a recording as pyarrow tables of `schema`, some ten thousand rows each.

    Missing samples have no rows: time and index jump. Times are whole microseconds. Samples of a
    bad channel and implausible slow values are NaN. Raises ConfigError if a file of the recording
    is unreadable.
    """
    tables, n_rows = [], 0
    for block in recording.blocks():
        tables.append(_table(block, schema))
        n_rows += block.n_samples
        if n_rows >= _ROWS_AT_ONCE:
            yield pa.concat_tables(tables)
            tables, n_rows = [], 0
    if tables:
        yield pa.concat_tables(tables)


def csv_schema(manifest: Manifest) -> Any:
    """Return the pyarrow schema of a CSV export; headings consist of channel id and unit.

    A heading that a spreadsheet could read as a formula starts with an apostrophe.
    """
    names = [f"{id_} [{unit}]" for id_, unit in _columns(manifest)]
    harmless = [f"'{n}" if n.startswith(_FORMULA_STARTS) else n for n in names]
    return _schema(manifest, "us", harmless)


def parquet_schema(manifest: Manifest) -> Any:
    """Return the pyarrow schema of a Parquet export; the metadata of each column contain its unit.

    Raises ConfigError if a channel has the name of a reserved column.
    """
    columns = _columns(manifest)
    for id_, _ in columns:
        if id_ in _OWN:
            raise ConfigError(f"channel '{id_}' has a name that Parquet exports reserve; use CSV")
    schema = _schema(manifest, "ns", [id_ for id_, _ in columns])
    for at, (_, unit) in enumerate(columns, start=len(_OWN)):
        schema = schema.set(at, schema.field(at).with_metadata({"unit": unit}))
    return schema.with_metadata({"unit": manifest.unit, "made_by": manifest.made_by})


_FORMATS: Mapping[ExportFormat, tuple[Callable[[Manifest], Any], Callable[[Any, Any], Any]]] = {
    ExportFormat.CSV: (csv_schema, pyarrow.csv.CSVWriter),
    ExportFormat.PARQUET: (parquet_schema, partial(pq.ParquetWriter, compression="zstd")),
}


def _columns(manifest: Manifest) -> list[tuple[str, str]]:
    waveforms = [(c.id, UNIT_OF[c.measurand]) for c in manifest.channels]
    return waveforms + [(c.id, c.unit) for c in manifest.slow_channels]


def _schema(manifest: Manifest, time_unit: str, names: list[str]) -> Any:
    types = [pa.float32()] * len(manifest.channels) + [pa.float64()] * len(manifest.slow_channels)
    time, epoch, index = _OWN
    return pa.schema(
        [
            pa.field(time, pa.timestamp(time_unit, tz="UTC")),
            pa.field(epoch, pa.int64()),
            pa.field(index, pa.int64()),
            *map(pa.field, names, types),
        ]
    )


def _table(block: SampleBlock, schema: Any) -> Any:
    side = block.side
    lengths = np.diff(side.starts, append=block.n_samples)
    since = np.arange(block.n_samples) - np.repeat(side.starts, lengths)
    since_ns = np.rint(since * (NS_PER_S / block.rate_hz)).astype(np.int64)
    times_us = (np.repeat(side.start_ns, lengths) + since_ns) // 1000
    is_bad = np.array([quality.level is Level.BAD for quality in VERDICTS])[block.verdicts]
    samples = np.where(np.repeat(is_bad, lengths, axis=1), np.float32(np.nan), block.samples)
    slow = [
        np.where((c.minimum <= values) & (values <= c.maximum), values, np.nan)
        for c, values in zip(block.calibration.slow, side.slow, strict=True)
    ]
    columns = [
        times_us if schema.field(0).type.unit == "us" else times_us * 1000,
        np.full(block.n_samples, block.epoch),
        np.arange(block.first_index, block.stop_index),
        *samples,
        *(np.repeat(values, lengths) for values in slow),
    ]
    arrays = [pa.array(c, type=field.type) for c, field in zip(columns, schema, strict=True)]
    return pa.table(arrays, schema=schema)
