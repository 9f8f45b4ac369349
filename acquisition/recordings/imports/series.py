"""Conversion of HDF5, TDMS and MDF files, read column by column, to rows."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from acquisition.delivery.units import require_unit
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import (
    ChannelColumn,
    Column,
    ColumnName,
    ImportJob,
    SlowColumn,
)
from acquisition.recordings.imports.rows import Rows
from acquisition.recordings.imports.times import TimeArray, from_start, numbers_to_ns
from acquisition.recordings.manifest import MAX_SAMPLES
from core.arrays import FloatArray, SampleArray

_SAME_GAIN = 1e-6
"""Relative tolerance for equal gains; smaller differences are rounding errors in files."""

_ROWS = 65_536
"""Number of rows per read of a column."""


Read: TypeAlias = Callable[[int, int], npt.NDArray[Any]]
"""Function (start, stop) that returns the rows of a column from `start` to `stop` (excluded)."""


@dataclass(frozen=True)
class Series:
    """Column of a measurement file.

    Parameters
    ----------
    unit
        Unit of measurement as stated in the file; None if the file states none.
    values
        Function that reads counts if `per_count` is given, else values in the unit of the file.
    per_count
        Value of one count in the unit of the file, for int16 counts with a linear scale.
    times_ns
        Function that reads the times that the format stores with the column, UTC in ns; None if it
        stores none.
    time_key
        Identifier of the time base; columns with the same key have the same times.
    """

    n_samples: int
    unit: str | None
    values: Read
    per_count: float | None = None
    times_ns: Read | None = None
    time_key: object = None


@dataclass(frozen=True)
class SeriesFile:
    """Access to the columns of an open measurement file.

    Parameters
    ----------
    find
        Function that returns a column by name, or raises ConfigError if the column is missing or
        ambiguous.
    start_ns
        Start time of the file's time column, UTC in ns; None if the file states none.
    """

    find: Callable[[ColumnName], Series]
    start_ns: int | None = None


def series_rows(file: SeriesFile, job: ImportJob) -> Iterator[Rows]:
    """Yield the rows of a measurement file with the columns that an import job selects.

    Raises ConfigError if the file does not match the job.
    """
    found = [_column(file, column) for column in job.channels]
    channels = list(zip(job.channels, found, strict=True))
    n_samples = _common_length(channels)
    keeps_counts = counts_are_kept(job, [series.per_count for series in found]) and all(
        series.values(0, 1).dtype == np.int16 for series in found
    )
    slow = [_SlowFeed(file, job, column, n_samples) for column in job.slow]
    has_own_times = job.time.kind == "file"
    clocks = {
        s.time_key if has_own_times else None: (c, _times_of(file, job, c, s)) for c, s in channels
    }
    for start in range(0, n_samples, _ROWS):
        stop = min(start + _ROWS, n_samples)
        times_ns = _common_times_ns(list(clocks.values()), start, stop)
        samples: list[Any] = [
            values.astype(np.int16) if keeps_counts else engineering_units(values, c, s.per_count)
            for c, s in channels
            for values in [_numbers(s.values, start, stop, c.place)]
        ]
        yield Rows(
            times_ns=times_ns,
            samples=np.stack(samples),
            slow=tuple(feed.at(times_ns) for feed in slow),
            done=stop / n_samples,
        )


def _column(file: SeriesFile, column: Column) -> Series:
    series = file.find(column.place)
    require_unit(column.place, series.unit, column.unit)
    return series


def _common_length(channels: Sequence[tuple[ChannelColumn, Series]]) -> int:
    first, n_samples = channels[0][0], channels[0][1].n_samples
    for column, series in channels:
        if series.n_samples != n_samples:
            raise ConfigError(
                f"column {str(column.place)!r} has {series.n_samples} samples, but column"
                f" {str(first.place)!r} has {n_samples}; waveform channels must be sampled together"
            )
    if not 1 <= n_samples <= MAX_SAMPLES:
        raise ConfigError(f"expected 1 to {MAX_SAMPLES} samples per channel, got {n_samples}")
    return n_samples


def _common_times_ns(
    clocks: Sequence[tuple[ChannelColumn, Read]], start: int, stop: int
) -> TimeArray:
    (first, read), *others = clocks
    times_ns: TimeArray = read(start, stop)
    for other, read_other in others:
        if np.any(np.abs(read_other(start, stop) - times_ns) > 1000):
            raise ConfigError(
                f"columns {str(other.place)!r} and {str(first.place)!r} differ in their times by"
                " more than 1 µs; waveform channels must be sampled together"
            )
    return times_ns


class _SlowFeed:
    """Reader of a slow channel; returns its values at the times of the waveforms."""

    def __init__(self, file: SeriesFile, job: ImportJob, column: SlowColumn, n_rows: int) -> None:
        self._series, self._slow = _column(file, column), column
        self._read_times_ns = _times_of(file, job, column, self._series)
        self._n_read = 0
        self._times_ns = np.empty(0, np.int64)
        self._values = np.full(1, np.nan)  # one more than times: [0] is valid before the first
        own_time = column.time is not None or job.time.kind == "file"
        if not own_time and self._series.n_samples != n_rows:
            raise ConfigError(
                f"slow channel {column.id} has {self._series.n_samples} values, but the waveforms"
                f" have {n_rows}; name a time column of the slow channel"
            )

    def at(self, times_ns: TimeArray) -> FloatArray:
        """Return the values valid at the given times; later calls must pass later times."""
        n_samples = self._series.n_samples
        while self._n_read < n_samples and not np.any(self._times_ns[-1:] > times_ns[-1]):
            self._read(self._n_read, min(self._n_read + _ROWS, n_samples))
        n_passed = np.searchsorted(self._times_ns, times_ns, side="right")
        found, last = self._values[n_passed], n_passed[-1]
        self._times_ns, self._values = self._times_ns[last:], self._values[last:]
        return found

    def _read(self, start: int, stop: int) -> None:
        self._times_ns = np.append(self._times_ns, self._read_times_ns(start, stop))
        if np.any(np.diff(self._times_ns) < 0):
            raise ConfigError(f"the times of slow channel {self._slow.id} go back; sort them")
        found = _numbers(self._series.values, start, stop, self._slow.place)
        scale = (self._series.per_count or 1.0) * self._slow.factor
        values = found.astype(np.float64) * scale + self._slow.offset
        self._values, self._n_read = np.append(self._values, values), stop


def _times_of(file: SeriesFile, job: ImportJob, column: Column, series: Series) -> Read:
    """Return a reader of the times of a column: its own time column, else the job's time axis."""
    own, axis = column.time if isinstance(column, SlowColumn) else None, job.time
    place = own or axis.place
    if own is None and axis.kind == "start":
        return lambda start, stop: from_start(axis.start_ns or 0, start, stop, job.rate_hz)
    if place is None:
        if series.times_ns is None:
            raise ConfigError(
                f"column {str(column.place)[:200]!r} has no times in the file; name a time column"
                " or a start"
            )
        return series.times_ns
    times = file.find(place)

    def times_ns(start: int, stop: int) -> TimeArray:
        values = _numbers(times.values, start, stop, place)
        if axis.form == "timestamp":
            return values.astype(np.int64)
        return numbers_to_ns(
            values, axis, file.start_ns if axis.start_ns is None else axis.start_ns
        )

    return times_ns


def _numbers(read: Read, start: int, stop: int, place: ColumnName) -> npt.NDArray[Any]:
    values = read(start, stop)
    if values.shape != (stop - start,) or values.dtype.kind not in "iuf":
        raise ConfigError(
            f"column {str(place)[:200]!r}: expected {stop - start} numbers, got {values.dtype} of"
            f" shape {values.shape}"
        )
    return values


def require_one(found: Sequence[Any], place: ColumnName, known: Sequence[str]) -> Any:
    """Return the only column in `found`, the columns of a file that match the name `place`.

    Raises ConfigError if no column or more than one column matches; the message lists `known`, the
    names of the columns in the file.
    """
    if len(found) != 1:
        words = f"occurs {len(found)} times; name its group" if found else "does not exist"
        names = ", ".join(known[:12])[:300]
        raise ConfigError(f"column {str(place)[:200]!r} {words}; the file has {names}")
    return found[0]


def counts_are_kept(job: ImportJob, per_count: Sequence[float | None]) -> bool:
    """Return whether all columns are counts with the gain of their channel's calibration.

    `per_count` are the values of one count of each column by the file; None if it states none.
    """
    gains = [found or c.per_count for c, found in zip(job.channels, per_count, strict=True)]
    return all(
        gain is not None
        and math.isclose(gain * c.factor, c.calibrated_per_count, rel_tol=_SAME_GAIN)
        for c, gain in zip(job.channels, gains, strict=True)
    )


def engineering_units(
    values: npt.NDArray[np.generic], channel: ChannelColumn, per_count: float | None
) -> SampleArray:
    """Return the values (n,) of a column in the unit of its channel; counts are scaled.

    `per_count` is the value of one count by the file; None if the file states none.
    """
    gain = channel.factor * (per_count or channel.per_count or 1.0)
    with np.errstate(over="ignore"):  # overflow to infinity marks the sample as unusable
        return (values.astype(np.float64) * gain).astype(np.float32)
