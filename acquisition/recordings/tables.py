"""Blocks as Parquet tables and back: the only module that knows pyarrow."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.limits import FOOTER_BYTES_PER_COLUMN
from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.pages import (
    NUMBER,
    REJECTED_COUNT,
    REJECTED_REASON,
    ColumnLimits,
    PageError,
    read_footer,
    require_bounded,
)
from core.arrays import RawArray

ZSTD_LEVEL = 1
"""Higher levels gain less than one per cent on differences that are already packed to bits."""

_SAMPLE_TYPES = {"int16": pa.int16(), "float32": pa.float32()}
_ENCODINGS = {"int16": "DELTA_BINARY_PACKED", "float32": "BYTE_STREAM_SPLIT"}
"""Differences of counts need few bits; floats that follow each other share their high bytes."""

_MAGIC = b"PAR1"
_TAIL_BYTES = 8  # length of the footer, then the magic
_REJECTION = pa.struct(
    [
        pa.field("reason", pa.string(), nullable=False),
        pa.field("n_samples", pa.int64(), nullable=False),
    ]
)
_REJECTED_LIMITS = (REJECTED_REASON, REJECTED_COUNT)
_REJECTED_COUNT = "rejected.list.element.n_samples"
_REJECTED = pa.list_(pa.field("element", _REJECTION, nullable=False))


def samples_schema(unit: RecordedUnit) -> Any:
    """Counts or engineering units, a column for each waveform channel."""
    type_ = _SAMPLE_TYPES[unit.sample_type]
    return pa.schema([pa.field(c.id, type_, nullable=False) for c in unit.channels])


def blocks_schema(unit: RecordedUnit) -> Any:
    """All of the blocks but their counts; ``ok`` has a bit for each channel, channel 0 lowest."""
    columns = [
        ("epoch", pa.int64()),
        ("first_index", pa.int64()),
        ("start_ns", pa.int64()),
        ("n_samples", pa.int32()),
        ("ok", pa.uint32()),
        *((f"slow:{c.id}", pa.float64()) for c in unit.slow_channels),
        ("rejected", _REJECTED),
    ]
    return pa.schema([pa.field(name, type_, nullable=False) for name, type_ in columns])


def samples_table(counts: RawArray, unit: RecordedUnit) -> Any:
    """(n_channels, n_samples) counts or engineering units as a table."""
    return pa.table(list(counts), schema=samples_schema(unit))


def blocks_table(blocks: Sequence[RawBlock], unit: RecordedUnit) -> Any:
    """Blocks without their counts as a table."""
    slow = [pa.array([b.slow[i] for b in blocks]) for i in range(len(unit.slow_channels))]
    rejected = [
        [{"reason": r.reason, "n_samples": r.n_samples} for r in b.rejected] for b in blocks
    ]
    columns = [
        [b.epoch for b in blocks],
        [b.first_index for b in blocks],
        [b.start_ns for b in blocks],
        [b.counts.shape[1] for b in blocks],
        [sum(ok << i for i, ok in enumerate(b.ok)) for b in blocks],
        *slow,
        rejected,
    ]
    return pa.table(columns, schema=blocks_schema(unit))


def samples_writer(path: Path, unit: RecordedUnit) -> Any:
    """Packed, then zstd: 6 bits a count where int16 itself takes 11."""
    schema = samples_schema(unit)
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=ZSTD_LEVEL,
        use_dictionary=False,
        write_statistics=False,
        store_schema=False,
        column_encoding=dict.fromkeys(schema.names, _ENCODINGS[unit.sample_type]),
    )


def blocks_writer(path: Path, unit: RecordedUnit) -> Any:
    """Few and repetitive: dictionaries and zstd; but no dictionary can multiply long texts."""
    schema = blocks_schema(unit)
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=ZSTD_LEVEL,
        use_dictionary=[*schema.names, _REJECTED_COUNT],
        write_statistics=False,
        store_schema=False,
    )


@contextmanager
def parquet_file(path: Path, schema: Any, n_rows: int, rows_per_group: int) -> Iterator[Any]:
    """Open a file after its footer has shown that it is what the manifest says, and no more.

    Raises
    ------
    ConfigError
        If it is not, or if reading it fails inside the context.
    """
    with foreign_errors_of(path), path.open("rb") as stream:
        full, last = divmod(n_rows, rows_per_group)
        group_rows = [rows_per_group] * full + [last] * (last > 0)
        footer_at = _small_footer(stream, path, schema, len(group_rows))
        footer = read_footer(stream, footer_at)
        stream.seek(0)
        with pq.ParquetFile(stream) as file:
            _require_shape(file, path, schema, n_rows, group_rows)
            require_bounded(stream, footer_at, footer, _limits(schema), group_rows)
            yield file


@contextmanager
def foreign_errors_of(path: Path) -> Iterator[None]:
    """Rename what pyarrow and the disk raise to ConfigError, with the path in front."""
    try:
        yield
    except (pa.ArrowException, OSError, PageError, UnicodeDecodeError) as error:
        # names may not be text
        words = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ConfigError(f"{path}: {words.splitlines()[0]}") from error


def read_counts(file: Any, group: int) -> RawArray:
    """(n_channels, n_rows) of one row group."""
    columns = file.read_row_group(group, use_threads=False).columns
    return np.stack([column.to_numpy() for column in columns])


def read_rows(file: Any, group: int, columns: list[str] | None = None) -> Iterable[dict[str, Any]]:
    """Rows of one row group as dictionaries."""
    rows: list[dict[str, Any]] = file.read_row_group(group, columns, use_threads=False).to_pylist()
    return rows


def _limits(schema: Any) -> list[ColumnLimits]:
    numbers = [NUMBER for name in schema.names if name != "rejected"]
    return numbers if len(numbers) == len(schema.names) else [*numbers, *_REJECTED_LIMITS]


def _small_footer(stream: Any, path: Path, schema: Any, n_groups: int) -> int:
    """Find the footer; refuse one that lists more than there can be, before anything parses it."""
    size = stream.seek(0, 2)
    stream.seek(max(0, size - _TAIL_BYTES))
    tail = stream.read(_TAIL_BYTES)
    if tail[4:] != _MAGIC:
        raise ConfigError(f"{path}: not a complete Parquet file")
    n_columns = len(schema.names) + 2  # rejections take three
    limit = FOOTER_BYTES_PER_COLUMN * n_columns * (n_groups + 2)
    n_bytes = int.from_bytes(tail[:4], "little")
    if n_bytes > limit:
        raise ConfigError(f"{path}: footer of {n_bytes} bytes, at most {limit} belong to this one")
    if n_bytes > size - _TAIL_BYTES:
        raise ConfigError(f"{path}: not a complete Parquet file")
    return int(size) - _TAIL_BYTES - n_bytes


def _require_shape(file: Any, path: Path, schema: Any, n_rows: int, group_rows: list[int]) -> None:
    found = file.schema_arrow
    if not found.equals(schema):
        name = next((a for a, b in zip(found, schema, strict=False) if a != b), None)
        words = f"column {name.name!r} of type {name.type}" if name else f"{len(found)} columns"
        raise ConfigError(f"{path}: {words} where the manifest says otherwise")
    metadata = file.metadata
    if metadata.num_rows != n_rows:
        raise ConfigError(f"{path}: {metadata.num_rows} rows, the manifest says {n_rows}")
    # never ask for a column's metadata: a lying footer makes pyarrow abort the process there
    found_rows = [metadata.row_group(n).num_rows for n in range(metadata.num_row_groups)]
    if found_rows != group_rows:
        raise ConfigError(f"{path}: not in row groups of {group_rows[0]}")
