"""Reader of CSV files, line by line, with limits on line length and number of columns."""

import csv
import math
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import numpy.typing as npt

from acquisition.delivery.units import require_unit, unit_in
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, ImportJob
from acquisition.recordings.imports.rows import Rows
from acquisition.recordings.imports.series import counts_are_kept, engineering_units, require_one
from acquisition.recordings.imports.times import TimeArray, from_start, numbers_to_ns, text_to_ns
from core.arrays import FloatArray, RawArray

CUT_OFF = "the line has no line end; add it if the file is complete"

MAX_LINE_BYTES = 1_000_000
MAX_COLUMNS = 4096
_ROWS = 4096
_CELLS = 2**20
"""Maximum number of rows and of cells in memory."""

_Columns: TypeAlias = Sequence[tuple[str, ...]]


def csv_rows(path: Path, job: ImportJob) -> Iterator[Rows]:
    """Yield the rows after the header; an empty cell of a slow channel repeats the previous value.

    Raises ConfigError if the file does not match the job; the message names the line.
    """
    with path.open("rb") as stream:
        yield from _CsvFile(stream, job).rows(max(path.stat().st_size, 1))


def _number(text: str) -> float:
    return float(text or "nan")


class _CsvFile:
    def __init__(self, stream: BinaryIO, job: ImportJob) -> None:
        self._job, self._stream = job, stream
        self._n_lines = self._n_rows = 0
        self._line_of: list[int] = []  # line numbers of the rows in memory
        for _ in range(job.csv.header_line - 1):
            next(self._lines(), None)
        self._cells = self._parsed()
        self._headings = [heading.strip() for heading in next(self._cells, [])]
        if len(self._headings) > MAX_COLUMNS:
            raise self._wrong(f"expected at most {MAX_COLUMNS} columns, got {len(self._headings)}")
        for column in (*job.channels, *job.slow):
            require_unit(column.place, unit_in(column.place.name), column.unit)
        self._channels = [self._column(c.place) for c in job.channels]
        self._slow = [self._column(c.place) for c in job.slow]
        self._time = self._column(job.time.place) if job.time.place else None
        self._newest = [math.nan] * len(job.slow)
        self._keeps_counts = counts_are_kept(job, [None] * len(job.channels))

    def rows(self, n_bytes: int) -> Iterator[Rows]:
        """Yield all rows; `n_bytes` is the size of the file, to compute the fraction read."""
        n_at_once = max(1, min(_ROWS, _CELLS // max(1, len(self._headings))))
        cells = self._complete()
        while table := list(islice(cells, n_at_once)):
            columns = list(zip(*table, strict=True))
            yield Rows(
                times_ns=self._times_ns(columns, len(table)),
                samples=self._samples(columns),
                slow=tuple(self._slow_values(n, columns) for n in range(len(self._slow))),
                done=min(self._stream.tell() / n_bytes, 1.0),
            )
            self._n_rows += len(table)
            self._line_of.clear()

    def _lines(self) -> Iterator[str]:
        while line := self._stream.readline(MAX_LINE_BYTES + 1):
            self._n_lines += 1
            if len(line) > MAX_LINE_BYTES:
                raise self._wrong(f"the line is longer than {MAX_LINE_BYTES} bytes")
            if not line.endswith(b"\n"):
                raise self._wrong(CUT_OFF)
            if b"\0" in line:
                raise self._wrong("the line contains a NUL byte")
            try:
                yield line.decode("utf-8-sig" if self._n_lines == 1 else "utf-8")
            except UnicodeDecodeError as error:
                raise self._wrong("the line is not valid UTF-8; save the file as UTF-8") from error

    def _parsed(self) -> Iterator[list[str]]:
        try:
            yield from csv.reader(self._lines(), delimiter=self._job.csv.delimiter, strict=True)
        except csv.Error as error:
            raise self._wrong(str(error)) from error

    def _complete(self) -> Iterator[list[str]]:
        for row in filter(None, self._cells):  # skips empty lines
            if len(row) != len(self._headings):
                raise self._wrong(f"expected {len(self._headings)} columns, got {len(row)}")
            self._line_of.append(self._n_lines)
            yield row

    def _column(self, place: ColumnName) -> int:
        found = [n for n, heading in enumerate(self._headings) if heading == place.name]
        return int(require_one(found, place, self._headings))

    def _times_ns(self, columns: _Columns, n_rows: int) -> TimeArray:
        axis, first = self._job.time, self._n_rows
        if self._time is None:
            return from_start(axis.start_ns or 0, first, first + n_rows, self._job.rate_hz)
        texts = columns[self._time]
        if axis.form == "iso8601":
            return text_to_ns(texts, axis)
        whole = (np.int64, "integer") if axis.form.endswith("_ns") else ()
        return numbers_to_ns(self._numbers(texts, *whole), axis, axis.start_ns)

    def _samples(self, columns: _Columns) -> RawArray:
        values = [self._numbers(columns[n]) for n in self._channels]
        if not self._keeps_counts:
            pairs = zip(self._job.channels, values, strict=True)
            return np.stack([engineering_units(v, channel, None) for channel, v in pairs])
        counts = np.stack(values)
        is_count = np.all((counts == np.rint(counts)) & (np.abs(counts + 0.5) < 32768), axis=0)
        if not np.all(is_count):
            line = self._line_of[int(np.argmin(is_count))]
            raise self._wrong("counts must be integers from -32768 to 32767", line)
        return counts.astype(np.int16)

    def _slow_values(self, number: int, columns: _Columns) -> FloatArray:
        column, texts = self._job.slow[number], columns[self._slow[number]]
        is_given = [bool(text.strip()) for text in texts]
        numbers = self._numbers([text if text.strip() else "" for text in texts])
        given = numbers[is_given] * column.factor + column.offset
        found: FloatArray = np.append(self._newest[number], given)[np.cumsum(is_given)]
        self._newest[number] = float(found[-1])
        return found

    def _numbers(
        self, texts: Sequence[str], of: Callable[[str], Any] = _number, noun: str = "number"
    ) -> npt.NDArray[Any]:
        """Return the numbers of a column; thousands separators are refused as ambiguous."""
        decimal, found = self._job.csv.decimal, list[Any]()
        for mark in {"_", "."} - {decimal}:
            if mark in "".join(texts):
                row, text = next((n, text) for n, text in enumerate(texts) if mark in text)
                raise self._wrong(f"number {text[:40]!r} contains {mark!r}", self._line_of[row])
        try:
            for text in texts:
                found.append(of(text.replace(decimal, ".")))
        except (ValueError, OverflowError) as error:
            text = texts[len(found)]
            what = f"{text[:40]!r} is not a valid {noun}"
            if decimal == "." and re.fullmatch(r"\s*[+-]?\d+,\d+\s*", text):
                what += '; if the comma is the decimal separator, set csv.decimal = ","'
            raise self._wrong(what, self._line_of[len(found)]) from error
        return np.array(found)

    def _wrong(self, what: str, line: int | None = None) -> ConfigError:
        """Return the error of a line, by default of the line that was read last."""
        return ConfigError(f"line {line or self._n_lines}: {what}")
