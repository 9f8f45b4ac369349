"""Files whose columns can be read from anywhere: one way to rows for HDF5, TDMS and MDF."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from acquisition.delivery.units import require_unit
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ChannelColumn, ColumnName, ImportJob, SlowColumn
from acquisition.recordings.imports.rows import Rows, SlowValues
from acquisition.recordings.imports.times import TimeArray, from_start, numbers_to_ns
from core.arrays import RawArray, SampleArray

MAX_SAMPLES = 2**29
"""Per channel, as in a recording."""

_SAME_GAIN = 1e-6
"""Gains that differ by less come from rounding in files; 24 bits cannot tell them apart."""

_ROWS = 65_536
_SLOW_ROWS = 4096


class Series(Protocol):
    """A column of a file."""

    unit: str | None
    """As the file has it."""

    n_samples: int

    per_count: float | None
    """Unit of the file per count, for a column of int16 counts with a linear scale."""

    time_key: object
    """Columns of the same key have the same times."""

    def values(self, start: int, stop: int) -> npt.NDArray[Any]:
        """Counts where `per_count` is given, else values in the file's unit."""
        ...

    def times_ns(self, start: int, stop: int) -> TimeArray:
        """By what the format itself has; raises ConfigError where it has nothing."""
        ...


class SeriesFile(ABC):
    """An opened file.

    Attributes
    ----------
    start_ns
        What its times count from, if the file has that.
    """

    start_ns: int | None = None

    def __init__(self) -> None:
        self._found: dict[ColumnName, Series] = {}

    def series(self, name: ColumnName) -> Series:
        """A column; raises ConfigError if it is not there, or there twice."""
        if name not in self._found:
            self._found[name] = self._find(name)
        return self._found[name]

    @abstractmethod
    def _find(self, name: ColumnName) -> Series:
        """Find a column that has not been asked for yet."""


class SeriesTable:
    """The columns of a job as rows; see :class:`acquisition.recordings.imports.rows.Table`."""

    def __init__(self, file: SeriesFile, job: ImportJob) -> None:
        self._file, self._job = file, job
        self._channels = [file.series(channel.place) for channel in job.channels]
        for channel, series in zip(job.channels, self._channels, strict=True):
            require_unit(channel.place, series.unit, channel.unit)
        self._n_samples = self._common_length()
        found = [series.per_count for series in self._channels]
        self.sample_type = (
            "int16" if counts_are_kept(job, found) and self._are_int16() else "float32"
        )
        self._slow = [self._slow_feed(column) for column in job.slow]

    def rows(self) -> Iterator[Rows]:
        """All rows."""
        for start in range(0, self._n_samples, _ROWS):
            stop = min(start + _ROWS, self._n_samples)
            times_ns = self._times_ns(start, stop)
            yield Rows(
                times_ns=times_ns,
                samples=self._samples(start, stop),
                slow=tuple(feed.up_to(int(times_ns[-1])) for feed in self._slow),
                done=stop / self._n_samples,
            )

    def _are_int16(self) -> bool:
        return all(series.values(0, 1).dtype == np.int16 for series in self._channels)

    def _common_length(self) -> int:
        lengths = [series.n_samples for series in self._channels]
        for channel, length in zip(self._job.channels, lengths, strict=True):
            if length != lengths[0]:
                raise ConfigError(
                    f"column {str(channel.place)!r} has {length} samples, column"
                    f" {str(self._job.channels[0].place)!r} has {lengths[0]}; waveform channels"
                    " are sampled together"
                )
        if not 1 <= lengths[0] <= MAX_SAMPLES:
            raise ConfigError(f"{lengths[0]} samples per channel; 1 to {MAX_SAMPLES} can be read")
        return lengths[0]

    def _times_ns(self, start: int, stop: int) -> TimeArray:
        first = _times_ns(self._file, self._job, None, self._channels[0], start, stop)
        if self._job.time.kind == "start" or self._job.time.place is not None:
            return first
        seen = {self._channels[0].time_key}
        for channel, series in zip(self._job.channels, self._channels, strict=True):
            if series.time_key not in seen:
                seen.add(series.time_key)
                if np.any(np.abs(series.times_ns(start, stop) - first) > 1000):
                    raise ConfigError(
                        f"column {str(channel.place)!r} was not sampled at the times of column"
                        f" {str(self._job.channels[0].place)!r}"
                    )
        return first

    def _samples(self, start: int, stop: int) -> RawArray:
        pairs = list(zip(self._job.channels, self._channels, strict=True))
        found = [_complete(s.values(start, stop), stop - start, c.place) for c, s in pairs]
        if self.sample_type == "int16":
            return np.stack(found).astype(np.int16, copy=False)
        return np.stack(
            [engineering_units(v, c, s.per_count) for v, (c, s) in zip(found, pairs, strict=True)]
        )

    def _slow_feed(self, column: SlowColumn) -> "_SlowFeed":
        series = self._file.series(column.place)
        require_unit(column.place, series.unit, column.unit)
        return _SlowFeed(self._file, self._job, column, series, self._n_samples)


class _SlowFeed:
    """Values of a slow channel in the order of time, a few thousand at once."""

    def __init__(
        self, file: SeriesFile, job: ImportJob, column: SlowColumn, series: Series, n_rows: int
    ) -> None:
        self._file, self._job, self._column, self._series = file, job, column, series
        self._next = 0
        own_time = column.time is not None or job.time.kind == "file"
        if not own_time and series.n_samples != n_rows:
            raise ConfigError(
                f"slow channel {column.id} has {series.n_samples} values, the waveforms {n_rows}:"
                " it needs a time column of its own"
            )

    def up_to(self, time_ns: int) -> SlowValues:
        """What follows, at least up to this time."""
        times: list[TimeArray] = [np.empty(0, np.int64)]
        values: list[npt.NDArray[Any]] = [np.empty(0)]
        while self._next < self._series.n_samples and not (
            len(times[-1]) and times[-1][-1] > time_ns
        ):
            start, stop = self._next, min(self._next + _SLOW_ROWS, self._series.n_samples)
            times.append(
                _times_ns(self._file, self._job, self._column.time, self._series, start, stop)
            )
            found = _complete(self._series.values(start, stop), stop - start, self._column.place)
            scale = (self._series.per_count or 1.0) * self._column.factor
            values.append(found.astype(np.float64) * scale + self._column.offset)
            self._next = stop
        return SlowValues(np.concatenate(times), np.concatenate(values))


def _times_ns(
    file: SeriesFile,
    job: ImportJob,
    column: ColumnName | None,
    series: Series,
    start: int,
    stop: int,
) -> TimeArray:
    """Times of samples of a series by its own time column, or as the job describes them."""
    if column is None and job.time.kind == "start":
        return from_start(job.time.start_ns or 0, start, stop, job.rate_hz)
    column = column or job.time.place
    if column is None:
        return series.times_ns(start, stop)
    values = _complete(file.series(column).values(start, stop), stop - start, column)
    if job.time.form == "timestamp":
        return values.astype(np.int64)
    return numbers_to_ns(values, job.time, job.time.start_ns or file.start_ns)


def _complete(values: npt.NDArray[Any], n_values: int, place: ColumnName) -> npt.NDArray[Any]:
    if values.shape != (n_values,) or values.dtype.kind not in "iuf":
        raise ConfigError(
            f"column {str(place)[:200]!r}: {values.dtype} of shape {values.shape} where"
            f" {n_values} numbers are needed"
        )
    return values


def require_one(found: Sequence[Any], place: ColumnName, known: Sequence[str]) -> Any:
    """The only one of what was found.

    Raises
    ------
    ConfigError
        If there is none, or more than one.
    """
    if len(found) != 1:
        words = f"there {len(found)} times: name its group" if found else "not there"
        names = ", ".join(known[:12])[:300]
        raise ConfigError(f"column {str(place)[:200]!r} is {words}; the file has {names}")
    return found[0]


def counts_are_kept(job: ImportJob, per_count: Sequence[float | None]) -> bool:
    """Whether all columns have counts, with just the gain of their channel's calibration.

    Parameters
    ----------
    per_count
        Unit of the file per count of each column, as stated in the file; None if it states none.
    """
    return all(
        gain is not None
        and math.isclose(gain * c.factor, c.calibrated_per_count, rel_tol=_SAME_GAIN)
        for c, gain in (
            (c, found or c.per_count) for c, found in zip(job.channels, per_count, strict=True)
        )
    )


def engineering_units(
    values: npt.NDArray[np.generic], channel: ChannelColumn, per_count: float | None
) -> SampleArray:
    """Values of a column in the unit of its channel; integers that are counts are scaled.

    Parameters
    ----------
    per_count
        As in :func:`counts_are_kept`.
    """
    gain = channel.factor * (per_count or channel.per_count or 1.0)
    with np.errstate(over="ignore"):  # beyond float32 is infinite, and so not finite
        return (values.astype(np.float64) * gain).astype(np.float32)
