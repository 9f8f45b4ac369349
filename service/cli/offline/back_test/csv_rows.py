"""Rows of a CSV file, as tables of a few ten thousand."""

import csv
from collections.abc import Iterator
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv

from service.cli.offline.back_test.cells import converted
from service.cli.offline.back_test.csv_lines import Lines, checked_lines
from service.cli.offline.back_test.file_columns import ReadingsError, check_headings


def csv_batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    """Read a file.

    Yields
    ------
    Rows, and how many bytes have been read.

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
