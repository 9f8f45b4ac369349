"""CSV files, read line by line with limits on lines and columns."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acquisition.delivery.units import require_unit, unit_in
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, ImportJob
from acquisition.recordings.imports.rows import Rows, SlowValues
from acquisition.recordings.imports.series import counts_are_kept, engineering_units
from acquisition.recordings.imports.times import TimeArray, from_start, numbers_to_ns, text_to_ns
from core.arrays import FloatArray, RawArray

CUT_OFF = "the file ends within it; if it is whole, put an end to its last line"

MAX_LINE_BYTES = 1_000_000
MAX_COLUMNS = 4096
_ROWS = 4096
_CELLS = 2**20
"""Rows and cells that are held at once."""


class CsvTable:
    """One heading for each column; an empty cell of a slow channel repeats the value before it."""

    def __init__(self, path: Path, job: ImportJob) -> None:
        self._job, self._path = job, path
        self._file = path.open("rb")
        self._size = max(path.stat().st_size, 1)
        self._lines = 0
        self._rows = csv.reader(self._texts(), delimiter=job.csv.delimiter, strict=True)
        self._headings = self._header()
        units = [(c.place, c.unit) for c in job.channels] + [(c.place, c.unit) for c in job.slow]
        for place, unit in units:
            require_unit(place, unit_in(place.name), unit)
        self._channels = [self._column(c.place) for c in job.channels]
        self._slow = [self._column(c.place) for c in job.slow]
        self._time = self._column(job.time.place) if job.time.place else None
        self.sample_type = (
            "int16" if counts_are_kept(job, [None] * len(job.channels)) else "float32"
        )
        self._n_rows = 0

    def rows(self) -> Iterator[Rows]:
        """All rows behind the header; see :class:`acquisition.recordings.imports.rows.Table`."""
        while table := self._next_rows():
            columns = list(zip(*table, strict=True))
            times_ns = self._times(columns, len(table))
            self._n_rows += len(table)
            yield Rows(
                times_ns=times_ns,
                samples=self._samples(columns),
                slow=self._slow_values(columns, times_ns),
                done=min(self._file.tell() / self._size, 1.0),
            )

    def _texts(self) -> Iterator[str]:
        while line := self._file.readline(MAX_LINE_BYTES + 1):
            self._lines += 1
            if len(line) > MAX_LINE_BYTES:
                raise self._wrong(f"longer than {MAX_LINE_BYTES} bytes")
            if not line.endswith(b"\n"):
                raise self._wrong(CUT_OFF)
            if b"\0" in line:
                raise self._wrong("has a NUL byte")
            try:
                yield line.decode("utf-8-sig" if self._lines == 1 else "utf-8")
            except UnicodeDecodeError as error:
                raise self._wrong("not UTF-8 text") from error

    def _header(self) -> list[str]:
        for _ in range(self._job.csv.header_line - 1):
            next(self._texts(), None)
        headings = [heading.strip() for heading in next(self._checked(), [])]
        if len(headings) > MAX_COLUMNS:
            raise self._wrong(f"{len(headings)} columns; at most {MAX_COLUMNS} are read")
        return headings

    def _checked(self) -> Iterator[list[str]]:
        try:
            yield from self._rows
        except csv.Error as error:
            raise self._wrong(str(error)) from error

    def _column(self, place: ColumnName) -> int:
        found = [n for n, heading in enumerate(self._headings) if heading == place.name]
        if len(found) != 1:
            words = f"there {len(found)} times" if found else "not there"
            names = ", ".join(self._headings[:12])[:300]
            raise ConfigError(f"column {place.name!r} is {words}; the file has {names}")
        return found[0]

    def _next_rows(self) -> list[list[str]]:
        table: list[list[str]] = []
        most = max(1, min(_ROWS, _CELLS // max(1, len(self._headings))))
        for row in filter(None, self._checked()):  # without empty lines
            if len(row) != len(self._headings):
                raise self._wrong(f"{len(row)} columns where the header has {len(self._headings)}")
            table.append(row)
            if len(table) == most:
                break
        return table

    def _times(self, columns: list[tuple[str, ...]], n_rows: int) -> TimeArray:
        axis = self._job.time
        if self._time is None:
            first = self._n_rows
            return from_start(axis.start_ns or 0, first, first + n_rows, self._job.rate_hz)
        texts = list(columns[self._time])
        if axis.form == "iso8601":
            return text_to_ns(texts, axis)
        if axis.form.endswith("_ns"):
            return numbers_to_ns(self._integers(texts), axis, axis.start_ns)
        return numbers_to_ns(self._numbers(texts), axis, axis.start_ns)

    def _integers(self, texts: list[str]) -> np.ndarray:
        self._require_plain(texts)
        try:
            return np.array(texts, dtype=np.int64)
        except (ValueError, OverflowError) as error:
            raise self._wrong("or one of those before it: no integer", texts) from error

    def _samples(self, columns: list[tuple[str, ...]]) -> RawArray:
        values = [self._numbers(list(columns[n])) for n in self._channels]
        if self.sample_type == "float32":
            pairs = zip(self._job.channels, values, strict=True)
            return np.stack([engineering_units(v, channel, None) for channel, v in pairs])
        counts = np.stack(values)
        if not np.all((counts == np.rint(counts)) & (np.abs(counts + 0.5) < 32768)):
            raise self._wrong("or one of those before it: no count of a 16-bit converter")
        return counts.astype(np.int16)

    def _slow_values(
        self, columns: list[tuple[str, ...]], times_ns: TimeArray
    ) -> tuple[SlowValues, ...]:
        found = []
        for number, column in zip(self._slow, self._job.slow, strict=True):
            texts = columns[number]
            given = [n for n, text in enumerate(texts) if text.strip()]
            values = self._numbers([texts[n] for n in given])
            found.append(SlowValues(times_ns[given], values * column.factor + column.offset))
        return tuple(found)

    def _numbers(self, texts: list[str]) -> FloatArray:
        self._require_plain(texts)
        if self._job.csv.decimal != ".":
            texts = [text.replace(self._job.csv.decimal, ".") for text in texts]
        try:
            return np.array([float(text) if text else math.nan for text in texts])
        except ValueError as error:
            raise self._wrong("or one of those before it: no number", texts) from error

    def _require_plain(self, texts: list[str]) -> None:
        """Refuse groups of thousands, which `float` would take for decimals, or leave out."""
        for mark in {"_", "."} - {self._job.csv.decimal}:
            if mark in "".join(texts):
                example = next(text for text in texts if mark in text)
                raise self._wrong(f"or one of those before it: {mark!r} in number {example[:40]!r}")

    def _wrong(self, what: str, texts: list[str] | None = None) -> ConfigError:
        example = next((text for text in texts or [] if not _is_number(text)), None)
        shown = f" {example[:40]!r}" if example is not None else ""
        return ConfigError(f"line {self._lines}: {what}{shown}")


def _is_number(text: str) -> bool:
    try:
        float(text or "nan")
    except ValueError:
        return False
    return True
