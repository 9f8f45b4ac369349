"""Readers of CSV and Parquet files of readings, run in a child process.

The child writes the checked rows as an Arrow stream. Its memory and time are limited and it cannot
write files, so that a hostile file harms only this process.
"""

import csv
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from acquisition.recordings.confined import confine
from core.arrays import TimeArray
from service.cli.offline.backtest_cells import MAX_ROWS, ReadingsError, check_headings, converted

CHUNK_BYTES = 4_000_000
MAX_LINE_BYTES = 16_384
"""Maximum length of a line, enough for a hundred columns; exported lines have up to 300 bytes."""

_BOM = b"\xef\xbb\xbf"


Lines = tuple[bytes, TimeArray]
"""Text of consecutive lines, and the (n,) line numbers of the non-empty ones."""


def _checked_lines(stream: BinaryIO) -> Iterator[Lines]:
    """Check the lines of a CSV file and yield them in blocks of some megabytes.

    Raises
    ------
    ReadingsError
        If a line is too long, is not UTF-8, or has a NUL, a lone carriage return or an open quote.
    """
    first, rest = 1, stream.read(len(_BOM)).removeprefix(_BOM)
    while chunk := stream.read(CHUNK_BYTES):
        text, found, rest = (rest + chunk).rpartition(b"\n")
        if found:
            yield _checked(text + found, first)
            first += text.count(b"\n") + 1
        if len(rest) > MAX_LINE_BYTES:
            raise ReadingsError(f"line {first}: the line is longer than {MAX_LINE_BYTES} bytes")
    if rest:
        yield _checked(rest + b"\n", first)


def _checked(text: bytes, first: int) -> Lines:
    lines = text.removesuffix(b"\n").split(b"\n")
    for number, line in enumerate(lines, first):
        if fault := _fault(line):
            raise ReadingsError(f"line {number}: {fault}")
    try:
        text.decode()
    except UnicodeDecodeError as error:
        number = first + text.count(b"\n", 0, error.start)
        raise ReadingsError(f"line {number}: not valid UTF-8; convert the file") from error
    return (text, np.array([n for n, line in enumerate(lines, first) if line.rstrip(b"\r")]))


def _fault(line: bytes) -> str | None:
    if len(line) > MAX_LINE_BYTES:
        return f"the line is longer than {MAX_LINE_BYTES} bytes"
    if b"\0" in line:
        return "the line contains a NUL byte"
    if b"\r" in line.removesuffix(b"\r"):
        return "the line contains a carriage return"
    return "a quote is not closed" if line.count(b'"') % 2 else None


def csv_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read the rows of a CSV file in batches.

    Yields
    ------
    tuple of pyarrow.RecordBatch and int
        Rows with the required column types, and the number of bytes read for them.

    Raises
    ------
    ReadingsError
        If the file is not a valid file of readings; the message names the lines.
    """
    headings: list[str] = []
    for text, numbers in _checked_lines(stream):
        if not headings and numbers.size:
            headings, text = _heading(text, numbers[0])
            numbers = numbers[1:]
        if numbers.size:
            yield converted(_table(text, numbers, headings), numbers, "line"), stream.tell()
    if not headings:
        raise ReadingsError("the file is empty; expected a heading")


def _heading(text: bytes, number: int) -> tuple[list[str], bytes]:
    line, _, rest = text.lstrip(b"\r\n").partition(b"\n")
    try:
        names = next(csv.reader([line.decode()], strict=True))
    except csv.Error as error:
        raise ReadingsError(f"line {number}: {error}") from error
    if len(names) == 1 and {";", "\t"} & set(names[0]):
        raise ReadingsError(f"line {number}: columns must be separated by commas")
    headings = [name.strip() for name in names]
    check_headings(headings)
    return headings, rest


def _table(text: bytes, numbers: TimeArray, headings: list[str]) -> Any:
    misfits: list[tuple[int, int]] = []

    def note(row: Any) -> str:
        misfits.append((row.number, row.actual_columns))
        return "error"

    try:
        table = pacsv.read_csv(
            pa.BufferReader(text),
            pacsv.ReadOptions(use_threads=False, block_size=len(text) + 1, column_names=headings),
            pacsv.ParseOptions(invalid_row_handler=note),
            pacsv.ConvertOptions(
                column_types=dict.fromkeys(headings, pa.string()),
                null_values=[""],
                strings_can_be_null=True,
            ),
        )
    except pa.ArrowInvalid as error:
        raise ReadingsError(_misfit(misfits, numbers, headings, error)) from error
    if len(table) != numbers.size:
        raise ReadingsError(f"line {numbers[0]} or later: a row cannot be read; check its quotes")
    if b" " not in text:
        return table
    columns = [pc.utf8_trim_whitespace(column) for column in table.columns]
    return pa.table([pc.if_else(pc.equal(c, ""), None, c) for c in columns], table.column_names)


def _misfit(
    misfits: list[tuple[int, int]], numbers: TimeArray, headings: list[str], error: Exception
) -> str:
    if not misfits:
        return f"line {numbers[0]} or a later line: {str(error).splitlines()[0]}"
    row, n_columns = misfits[0]
    return f"line {numbers[row - 1]}: expected {len(headings)} columns, got {n_columns}"


MAGIC = b"PAR1"
_ROWS = 65_536
_BUFFER_BYTES = 1_000_000
"""Size of the buffer of a column; without a buffer, a whole row group is read into memory."""


def parquet_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read the rows of a Parquet file in batches; a malformed file may crash the process.

    Yields
    ------
    tuple of pyarrow.RecordBatch and int
        Rows with the required column types, and the approximate number of bytes read for them.

    Raises
    ------
    ReadingsError
        If the file is not a valid file of readings; the message names the rows.
    """
    try:
        yield from _batches(stream)
    except pa.ArrowMemoryError:
        raise  # the process is out of memory; the file may be fine
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        words = str(error) or type(error).__name__
        raise ReadingsError(f"damaged Parquet file: {words.splitlines()[0][:200]}") from error


def _batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    with pq.ParquetFile(stream, buffer_size=_BUFFER_BYTES) as file:
        headings = list(file.schema_arrow.names)
        check_headings(headings)
        n_rows = file.metadata.num_rows
        if n_rows > MAX_ROWS:
            raise ReadingsError(f"expected at most {MAX_ROWS} rows, got {n_rows}; split the file")
        n_read = 0
        for batch in file.iter_batches(_ROWS, use_threads=False):
            row = np.arange(n_read + 1, n_read + len(batch) + 1)
            n_read += len(batch)
            if len(batch):
                yield converted(pa.Table.from_batches([batch]), row, "row"), size * n_read // n_rows
        if n_read != n_rows:
            raise ReadingsError(
                f"damaged Parquet file: it has {n_read} rows, but its footer states {n_rows}"
            )


MEMORY_BYTES = 3 * 2**30
WRONG_FILE = 3
"""Exit code of a wrong file; standard error holds a message for the user."""


def main() -> None:
    """Write the rows of the file named by the first argument to standard output (Arrow stream).

    Limits memory, time and file access of the process first. A wrong file ends the process with
    exit code `WRONG_FILE` and a message.
    """
    confine(MEMORY_BYTES)
    try:
        with Path(sys.argv[1]).open("rb") as stream:
            is_parquet = stream.read(len(MAGIC)) == MAGIC
            stream.seek(0)
            batches = parquet_batches(stream) if is_parquet else csv_batches(stream)
            _send(batches, sys.stdout.buffer)
    except (ReadingsError, OSError) as error:
        words = error.strerror if isinstance(error, OSError) else str(error)
        _end(words or str(error))
    except MemoryError:  # pyarrow's error is a subclass
        _end(f"reading requires more than {MEMORY_BYTES >> 30} GiB of memory")


def _send(batches: Iterator[tuple[Any, int]], out: BinaryIO) -> None:
    n_rows, writer = 0, None
    for batch, n_bytes in batches:
        n_rows += len(batch)
        if n_rows > MAX_ROWS:
            raise ReadingsError(f"expected at most {MAX_ROWS} rows, got more; split the file")
        writer = writer or pa.ipc.new_stream(out, batch.schema)
        writer.write_batch(batch, custom_metadata={"n_bytes": str(n_bytes)})
    if writer is None:
        raise ReadingsError("the file has no rows below its heading")
    writer.close()


def _end(words: str) -> None:
    sys.stderr.write(words[:2000])
    sys.exit(WRONG_FILE)


if __name__ == "__main__":
    main()
