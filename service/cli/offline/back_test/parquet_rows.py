"""Rows of a Parquet file, as tables of a few ten thousand."""

from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from service.cli.offline.back_test.cells import converted
from service.cli.offline.back_test.file_columns import MAX_ROWS, ReadingsError, check_headings

MAGIC = b"PAR1"
MAX_FOOTER_BYTES = 64_000_000
_TAIL_BYTES = 8
_ROWS = 65_536
_BUFFER_BYTES = 1_000_000
"""Of each column; without it all of a row group would be held at once."""


def parquet_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read a file; to be done where a lying file may take a process down with it.

    Yields
    ------
    Rows, and about how many bytes have been read.

    Raises
    ------
    ReadingsError
        Where it is wrong.
    """
    size = stream.seek(0, 2)
    stream.seek(max(0, size - _TAIL_BYTES))
    tail = stream.read(_TAIL_BYTES)
    n_footer = int.from_bytes(tail[:4], "little")
    if tail[4:] != MAGIC or n_footer > size - _TAIL_BYTES - len(MAGIC):
        raise ReadingsError("not a complete Parquet file")
    if n_footer > MAX_FOOTER_BYTES:
        raise ReadingsError(f"a footer of {n_footer} bytes, at most {MAX_FOOTER_BYTES} are read")
    stream.seek(0)
    try:
        yield from _batches(stream, size)
    except pa.ArrowMemoryError:
        raise  # of the process, not of the file
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        words = str(error) or type(error).__name__
        raise ReadingsError(f"not a sound Parquet file: {words.splitlines()[0][:200]}") from error


def _batches(stream: BinaryIO, size: int) -> Iterator[tuple[Any, int]]:
    with pq.ParquetFile(stream, buffer_size=_BUFFER_BYTES) as file:
        headings = list(file.schema_arrow.names)
        check_headings(headings)
        n_rows = file.metadata.num_rows
        if n_rows > MAX_ROWS:
            raise ReadingsError(f"{n_rows} rows; at most {MAX_ROWS} are read")
        n_read = 0
        for batch in file.iter_batches(_ROWS, use_threads=False):
            row = np.arange(n_read + 1, n_read + len(batch) + 1)
            n_read += len(batch)
            if len(batch):
                yield converted(pa.Table.from_batches([batch]), row, "row"), size * n_read // n_rows
        if n_read != n_rows:
            raise ReadingsError(f"has {n_read} rows and says {n_rows}")
