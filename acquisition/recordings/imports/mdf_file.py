"""MDF version 4, the measurement format of ASAM."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, ImportJob
from acquisition.recordings.imports.series import SeriesFile, require_one
from acquisition.recordings.imports.times import TimeArray, library, utc_ns

_MAGIC = b"MDF     4"
_LOCAL_TIME = 1
_NO_CONVERSION, _LINEAR = 0, 1
_INVALID = 0b11
"""Flags of a channel whose samples are all invalid, or invalid where a bit is set."""


class MdfFile(SeriesFile):
    """A name is that of a channel and, where needed, name or number of its group."""

    def __init__(self, path: Path, job: ImportJob) -> None:
        super().__init__()
        with path.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:  # asammdf would unpack archives to the disk
                raise ConfigError("not an MDF file of version 4, or not finished")
        self._mdf = library("asammdf", "MDF4").MDF(path)
        header = self._mdf.header
        is_local = bool(header.time_flags & _LOCAL_TIME)
        offset_s = job.time.utc_offset_s if is_local else 0
        self.start_ns: int = int(header.abs_time) - offset_s * 1_000_000_000

    def _find(self, place: ColumnName) -> "_MdfSeries":
        all_places = self._mdf.channels_db.get(place.name, ())
        places = [at for at in all_places if self._is_in(at[0], place.group)]
        group, index = require_one(places, place, list(self._mdf.channels_db)[:12])
        return _MdfSeries(self._mdf, group, index, place, self.start_ns)

    def _is_in(self, number: int, wanted: str) -> bool:
        name = str(self._mdf.groups[number].channel_group.acq_name or "")
        return wanted in ("", str(number), name)


class _MdfSeries:
    def __init__(self, mdf: Any, group: int, index: int, place: ColumnName, start_ns: int) -> None:
        self._mdf, self._group, self._index, self._start_ns = mdf, group, index, start_ns
        channel = mdf.groups[group].channels[index]
        self.n_samples = int(mdf.groups[group].channel_group.cycles_nr)
        self.time_key: object = group
        conversion = channel.conversion
        kind = _NO_CONVERSION if conversion is None else conversion.conversion_type
        if kind not in (_NO_CONVERSION, _LINEAR):
            raise ConfigError(
                f"channel {str(place)[:200]!r} has a conversion of kind {kind}; only linear ones"
                " are read"
            )
        is_linear = kind == _LINEAR
        self._gain = float(conversion.a) if is_linear else 1.0
        self._offset = float(conversion.b) if is_linear else 0.0
        unit = (conversion.unit if conversion is not None else "") or channel.unit
        self.unit: str | None = str(unit or "")
        is_int16 = channel.bit_count == 16 and self._raw(0, 1).dtype == np.int16
        keeps = is_int16 and is_linear and self._offset == 0.0 and not channel.flags & _INVALID
        self.per_count: float | None = float(self._gain) if keeps else None

    def values(self, start: int, stop: int) -> npt.NDArray[Any]:
        raw = self._raw(start, stop)
        if self.per_count is not None or (self._gain, self._offset) == (1.0, 0.0):
            return raw
        scaled: npt.NDArray[Any] = raw.astype(np.float64) * self._gain + self._offset
        return scaled

    def times_ns(self, start: int, stop: int) -> TimeArray:
        since_s = self._mdf.get_master(
            self._group, record_offset=start, record_count=stop - start
        ).astype(np.float64)
        us = np.rint(since_s * 1e6)
        if len(us) != stop - start or not np.all(np.abs(us) < 2**53):
            raise ConfigError("a group without a usable time channel")
        return utc_ns(us.astype(np.int64), self._start_ns)

    def _raw(self, start: int, stop: int) -> npt.NDArray[Any]:
        samples, invalid = self._mdf.get(
            group=self._group,
            index=self._index,
            samples_only=True,
            raw=True,
            ignore_invalidation_bits=True,  # else what is invalid is left out, and the rest moves
            record_offset=start,
            record_count=stop - start,
        )
        found: npt.NDArray[Any] = np.asarray(samples)
        if invalid is not None and np.any(invalid):
            found = np.where(invalid, np.nan, found)
        return found
