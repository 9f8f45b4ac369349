"""Conversion of blocks to Parquet tables, and reading of these tables.

Columns are read with `numpy.from_dlpack`: `to_numpy` of pyarrow imports pandas, if it is installed,
which takes 0.2 s in each fork of the confined child.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import MAX_REASON_LENGTH, RecordedUnit
from acquisition.recordings.messages import HEAD_NUMBERS, Heads, Rejected, head_type
from core.arrays import RawArray
from core.samples.blocks import Rejection

ZSTD_LEVEL = 1
"""Compression level; higher levels save less than 1 % on bit-packed differences."""

_SAMPLE_TYPES = {"int16": pa.int16(), "float32": pa.float32()}
_ENCODINGS = {"int16": "DELTA_BINARY_PACKED", "float32": "BYTE_STREAM_SPLIT"}
"""Parquet encodings: differences of counts need few bits; successive floats share high bytes."""

_HEADS_AT_ONCE = 256
_REJECTED_COUNT = "rejected.list.element.n_samples"


def _required(types: Mapping[str, Any]) -> list[Any]:
    return [pa.field(name, type_, nullable=False) for name, type_ in types.items()]


def samples_schema(unit: RecordedUnit) -> Any:
    """Return the pyarrow schema of the samples: one column per waveform channel."""
    type_ = _SAMPLE_TYPES[unit.sample_type]
    return pa.schema(_required({c.id: type_ for c in unit.channels}))


def blocks_schema(unit: RecordedUnit) -> Any:
    """Return the pyarrow schema of block headers; bit 0 of ``ok`` is that of channel 0."""
    rejection = pa.struct(_required({"reason": pa.string(), "n_samples": pa.int64()}))
    types = dict.fromkeys(("epoch", "first_index", "start_ns"), pa.int64())
    types |= {"n_samples": pa.int32(), "ok": pa.uint32()}
    types |= {f"slow:{c.id}": pa.float64() for c in unit.slow_channels}
    types |= {"rejected": pa.list_(*_required({"element": rejection}))}
    return pa.schema(_required(types))


def blocks_table(heads: Heads, rejected: Sequence[Sequence[Rejection]], unit: RecordedUnit) -> Any:
    """Return a pyarrow table with one row per block: its header, and the rejections before it."""
    columns = [
        *(heads[name] for name in HEAD_NUMBERS),
        *heads["slow"].T,
        [[asdict(rejection) for rejection in of_block] for of_block in rejected],
    ]
    schema = blocks_schema(unit)
    arrays = [pa.array(c, field.type) for c, field in zip(columns, schema, strict=True)]
    return pa.table(arrays, schema=schema)


def samples_writer(path: Path, unit: RecordedUnit) -> Any:
    """Open a Parquet writer of samples; delta encoding and zstd take 6 bits per count.

    Without delta encoding, zstd takes 11 bits per count. Floats use byte-stream-split encoding.
    """
    schema, encoding = samples_schema(unit), _ENCODINGS[unit.sample_type]
    encodings = dict.fromkeys(schema.names, encoding)
    return _writer(path, schema, use_dictionary=False, column_encoding=encodings)


def blocks_writer(path: Path, unit: RecordedUnit) -> Any:
    """Open a Parquet writer of block headers; all columns except texts are dictionary-encoded."""
    schema = blocks_schema(unit)
    return _writer(path, schema, use_dictionary=[*schema.names, _REJECTED_COUNT])


def _writer(path: Path, schema: Any, **options: Any) -> Any:
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=ZSTD_LEVEL,
        write_statistics=False,
        store_schema=False,
        **options,
    )


@contextmanager
def parquet_file(path: Path, schema: Any, n_rows: int, rows_per_group: int) -> Iterator[Any]:
    """Open a Parquet file, check its columns and numbers of rows in its footer, and yield it.

    Only for use in the confined child, because pyarrow allocates the size stated in a page header:
    up to 2 GB for a page of 64 kB.

    Raises ConfigError if the footer differs from `schema`, `n_rows` or `rows_per_group`, or if
    reading fails inside the context.
    """
    full, last = divmod(n_rows, rows_per_group)
    with foreign_errors_of(path), path.open("rb") as stream, pq.ParquetFile(stream) as file:
        _require_shape(file, path, schema, n_rows, [rows_per_group] * full + [last] * (last > 0))
        yield file


@contextmanager
def foreign_errors_of(path: Path) -> Iterator[None]:
    """Raise errors of pyarrow and of the disk as ConfigError, with the path in the message."""
    try:
        yield
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        # column names may be invalid UTF-8
        words = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ConfigError(f"{path}: {words.splitlines()[0]}") from error


def read_counts(file: Any, group: int) -> RawArray:
    """Return the (n_channels, n_rows) samples of one row group."""
    columns = file.read_row_group(group, use_threads=False).columns
    return np.stack([np.from_dlpack(column.combine_chunks()) for column in columns])


def read_heads(file: Any, n_slow: int) -> Iterator[tuple[Heads, list[Rejected]]]:
    """Yield block headers and the rejections before them, some hundred blocks at a time."""
    for batch in file.iter_batches(_HEADS_AT_ONCE, use_threads=False):
        *numbers, rejected = batch.columns
        heads = np.empty(len(batch), head_type(n_slow))
        for name, column in zip(HEAD_NUMBERS, numbers, strict=False):
            heads[name] = np.from_dlpack(column)
        for n, column in enumerate(numbers[len(HEAD_NUMBERS) :]):
            heads["slow"][:, n] = np.from_dlpack(column)
        yield (
            heads,
            [
                (row, each["reason"][: MAX_REASON_LENGTH + 1], each["n_samples"])
                for row, rejections in enumerate(rejected.to_pylist())
                for each in rejections
            ],
        )


def _described(column: Any) -> str:
    return f"'{column.name}' ({column.type}{'' if column.nullable else ', not null'})"


def _require_shape(file: Any, path: Path, schema: Any, n_rows: int, group_rows: list[int]) -> None:
    found, metadata = file.schema_arrow, file.metadata
    if not found.equals(schema):
        pairs = zip(found, schema, strict=False)
        differing = ((f"column {_described(a)}", _described(b)) for a, b in pairs if a != b)
        words, wanted = next(differing, (f"{len(found)} columns", str(len(schema))))
        raise ConfigError(f"{path}: file has {words}, but the manifest requires {wanted}")
    if metadata.num_rows != n_rows:
        raise ConfigError(f"{path}: file has {metadata.num_rows} rows, expected {n_rows}")
    found_rows = [metadata.row_group(n).num_rows for n in range(metadata.num_row_groups)]
    if found_rows != group_rows:
        raise ConfigError(
            f"{path}: row groups must have {group_rows[0]} rows, got {found_rows[:3]}"
        )
