"""Rows of CSV and Parquet files of readings, as checked Arrow tables."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from core.arrays import TimeArray
from service.cli.offline.backtest_cells import MAX_ROWS, ReadingsError, check_headings, converted

CHUNK_BYTES = 4_000_000
MAX_LINE_BYTES = 16_384
"""Longest line, for a hundred columns; padwatch's own lines have 300 bytes at most."""

_BOM = b"\xef\xbb\xbf"
_NUL, _LF, _CR, _QUOTE = 0, 10, 13, 34


@dataclass(frozen=True, eq=False)
class Lines:
    """Consecutive lines.

    Parameters
    ----------
    text
        UTF-8, each line with its end.
    number : (n,)
        Numbers of the lines that are not empty, counted in the file.
    """

    text: bytes
    number: TimeArray


def checked_lines(stream: BinaryIO) -> Iterator[Lines]:
    """Read a file from its beginning.

    Raises
    ------
    ReadingsError
        At a line that is not text, too long, or has a NUL, a lone carriage return or an open quote.
    """
    first, rest = 1, stream.read(len(_BOM)).removeprefix(_BOM)
    while chunk := stream.read(CHUNK_BYTES):
        text, found, rest = (rest + chunk).rpartition(b"\n")
        if found:
            yield _checked(text + found, first)
            first += text.count(b"\n") + 1
        if len(rest) > MAX_LINE_BYTES:
            raise ReadingsError(f"line {first}: longer than {MAX_LINE_BYTES} bytes")
    if rest:
        yield _checked(rest + b"\n", first)


def _checked(text: bytes, first: int) -> Lines:
    byte = np.frombuffer(text, np.uint8)
    end = np.flatnonzero(byte == _LF)
    length = np.diff(end, prepend=-1) - 1
    _refuse(length > MAX_LINE_BYTES, first, f"longer than {MAX_LINE_BYTES} bytes")
    _refuse_at(np.flatnonzero(byte == _NUL), end, first, "has a NUL byte")
    returns = np.flatnonzero(byte == _CR)
    _refuse_at(returns[byte[returns + 1] != _LF], end, first, "a carriage return within the line")
    quotes = np.searchsorted(np.flatnonzero(byte == _QUOTE), end)
    _refuse(np.diff(quotes, prepend=0) % 2 == 1, first, "a quote is not closed")
    try:
        text.decode()
    except UnicodeDecodeError as error:
        _refuse_at(np.array([error.start]), end, first, "not UTF-8 text")
    is_return = byte[np.maximum(end - 1, 0)] == _CR
    return Lines(text, first + np.flatnonzero(length > is_return))


def _refuse_at(at: npt.NDArray[np.int64], end: npt.NDArray[np.int64], first: int, why: str) -> None:
    if at.size:
        raise ReadingsError(f"line {first + int(np.searchsorted(end, at[0]))}: {why}")


def _refuse(is_wrong: npt.NDArray[np.bool_], first: int, why: str) -> None:
    if is_wrong.any():
        raise ReadingsError(f"line {first + int(np.argmax(is_wrong))}: {why}")


def csv_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read a file.

    Yields
    ------
    Rows, and the number of bytes read.

    Raises
    ------
    ReadingsError
        Where it is wrong.
    """
    headings: list[str] = []
    for lines in checked_lines(stream):
        if not headings and lines.number.size:
            headings, lines = _heading(lines)
        if lines.number.size:
            yield converted(_table(lines, headings), lines.number, "line"), stream.tell()
    if not headings:
        raise ReadingsError("is empty: there is no heading")


def _heading(lines: Lines) -> tuple[list[str], Lines]:
    text = lines.text.lstrip(b"\r\n")
    line, _, rest = text.partition(b"\n")
    try:
        names = next(csv.reader([line.decode()], strict=True))
    except csv.Error as error:
        raise ReadingsError(f"line {lines.number[0]}: {error}") from error
    if len(names) == 1 and {";", "\t"} & set(names[0]):
        raise ReadingsError(f"line {lines.number[0]}: columns must be separated by commas")
    headings = [name.strip() for name in names]
    check_headings(headings)
    return headings, Lines(rest, lines.number[1:])


def _table(lines: Lines, headings: list[str]) -> Any:
    misfits: list[tuple[int, int]] = []

    def note(row: Any) -> str:
        misfits.append((row.number, row.actual_columns))
        return "error"

    try:
        table = pacsv.read_csv(
            pa.BufferReader(lines.text),
            pacsv.ReadOptions(
                use_threads=False, block_size=len(lines.text) + 1, column_names=headings
            ),
            pacsv.ParseOptions(invalid_row_handler=note),
            pacsv.ConvertOptions(
                column_types=dict.fromkeys(headings, pa.string()),
                null_values=[""],
                strings_can_be_null=True,
            ),
        )
    except pa.ArrowInvalid as error:
        raise ReadingsError(_misfit(misfits, lines, headings, error)) from error
    if len(table) != lines.number.size:
        raise ReadingsError(f"line {lines.number[0]} or one of those behind it: not a row")
    return _trimmed(table) if b" " in lines.text else table


def _misfit(
    misfits: list[tuple[int, int]], lines: Lines, headings: list[str], error: Exception
) -> str:
    if not misfits:
        return f"line {lines.number[0]} or one of those behind it: {str(error).splitlines()[0]}"
    row, n_columns = misfits[0]
    return (
        f"line {lines.number[row - 1]}: {n_columns} columns where the heading has {len(headings)}"
    )


def _trimmed(table: Any) -> Any:
    columns = [pc.utf8_trim_whitespace(column) for column in table.columns]
    return pa.table([pc.if_else(pc.equal(c, ""), None, c) for c in columns], table.column_names)


MAGIC = b"PAR1"
MAX_FOOTER_BYTES = 64_000_000
_TAIL_BYTES = 8
_ROWS = 65_536
_BUFFER_BYTES = 1_000_000
"""Buffer of each column; without it a whole row group would be in memory."""


def parquet_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read a file; call it in a child process, which a malformed file may crash.

    Yields
    ------
    Rows, and the approximate number of bytes read.

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
        raise  # the process is out of memory; the file may be fine
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
