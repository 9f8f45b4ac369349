"""Reader of MDF 4 files, the measurement data format of ASAM."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, ImportJob
from acquisition.recordings.imports.series import Series, SeriesFile, require_one
from acquisition.recordings.imports.times import TimeArray, library, utc_ns
from core.units import NS_PER_S

_MAGIC = b"MDF     4"
_LOCAL_TIME = 1
_NO_CONVERSION, _LINEAR = 0, 1
_INVALID = 0b11
"""Channel flags: all samples are invalid, or samples have invalidation bits."""


def mdf_file(path: Path, job: ImportJob) -> SeriesFile:
    """Open an MDF file; columns are named by channel and, if ambiguous, by group name or number.

    Raises `ConfigError` if the file is not a finished MDF 4 file, or asammdf is not installed.
    """
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:  # asammdf extracts archives to the disk
            raise ConfigError("not a finished MDF file of version 4; convert it to MDF 4")
    mdf = library("asammdf", "MDF4").MDF(path)
    is_local = bool(mdf.header.time_flags & _LOCAL_TIME)
    offset_s = job.time.utc_offset_s if is_local else 0
    start_ns = int(mdf.header.abs_time) - offset_s * NS_PER_S

    def find(place: ColumnName) -> Series:
        places = [
            (group, index)
            for group, index in mdf.channels_db.get(place.name, ())
            if place.group in ("", str(group), mdf.groups[group].channel_group.acq_name)
        ]
        group, index = require_one(places, place, list(mdf.channels_db)[:12])
        return _series(mdf, group, index, place, start_ns)

    return SeriesFile(find, start_ns)


def _series(mdf: Any, group: int, index: int, place: ColumnName, start_ns: int) -> Series:
    channel = mdf.groups[group].channels[index]
    conversion = channel.conversion
    kind = _NO_CONVERSION if conversion is None else conversion.conversion_type
    if kind not in (_NO_CONVERSION, _LINEAR):
        raise ConfigError(
            f"channel {str(place)[:200]!r} has a conversion of type {kind}; only linear"
            " conversions are supported"
        )
    is_linear = kind == _LINEAR
    gain, offset = (float(conversion.a), float(conversion.b)) if is_linear else (1.0, 0.0)

    def raw(start: int, stop: int) -> npt.NDArray[Any]:
        samples, invalid = mdf.get(
            group=group,
            index=index,
            samples_only=True,
            raw=True,
            ignore_invalidation_bits=True,  # else invalid samples are removed, which shifts others
            record_offset=start,
            record_count=stop - start,
        )
        is_invalid = invalid is not None and np.any(invalid)
        return np.where(invalid, np.nan, samples) if is_invalid else np.asarray(samples)

    def scaled(start: int, stop: int) -> npt.NDArray[Any]:
        return raw(start, stop).astype(np.float64) * gain + offset

    def times_ns(start: int, stop: int) -> TimeArray:
        found = mdf.get_master(group, record_offset=start, record_count=stop - start)
        us = np.rint(found.astype(np.float64) * 1e6)
        if len(us) != stop - start or not np.all(np.abs(us) < 2**53):
            raise ConfigError(f"channel group {group} has no valid time channel")
        return utc_ns(us.astype(np.int64), start_ns)

    is_int16 = channel.bit_count == 16 and raw(0, 1).dtype == np.int16
    keeps = is_int16 and is_linear and offset == 0.0 and not channel.flags & _INVALID
    return Series(
        n_samples=int(mdf.groups[group].channel_group.cycles_nr),
        unit=str((conversion.unit if conversion is not None else "") or channel.unit or ""),
        values=raw if keeps or (gain, offset) == (1.0, 0.0) else scaled,
        per_count=gain if keeps else None,
        times_ns=times_ns,
        time_key=group,
    )
