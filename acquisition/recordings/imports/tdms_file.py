"""Reader of TDMS files (National Instruments, LabVIEW): channels in groups."""

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName
from acquisition.recordings.imports.series import Series, SeriesFile, require_one
from acquisition.recordings.imports.times import TimeArray, from_start, library
from core.units import NS_PER_S

_EPOCH_1904_S = -2_082_844_800
_UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")
_WAVEFORM_PROPERTIES = ("wf_start_time", "wf_increment", "wf_start_offset")
_SCALE = "NI_Scale[0]_"

_LEAD = struct.Struct("<4sL4xQ8x")
"""Lead-in of a segment: tag, table of contents, next segment offset. Source: NI, TDMS format."""

_BIG_ENDIAN = 1 << 6
_UNFINISHED = 2**64 - 1


def tdms_file(path: Path) -> SeriesFile:
    """Open a TDMS file; columns are named by group and channel, times from waveform properties.

    Raises `ConfigError` if the file is incomplete, or npTDMS is not installed.
    """
    stream = path.open("rb")  # not a path: npTDMS would use an index file beside it
    _require_whole(stream)
    file = library("nptdms", "TDMS").TdmsFile.open(stream, raw_timestamps=True)

    def find(place: ColumnName) -> Series:
        channels = [
            channel
            for group in file.groups()
            if place.group in ("", group.name)
            for channel in group.channels()
            if channel.name == place.name
        ]
        known = [f"{g.name}/{c.name}" for g in file.groups() for c in g.channels()[:12]]
        return _series(require_one(channels, place, known))

    return SeriesFile(find)


def _series(channel: Any) -> Series:
    properties, per_count = channel.properties, _per_count(channel)

    def values(start: int, stop: int) -> npt.NDArray[Any]:
        found = np.asarray(channel.read_data(start, stop - start, scaled=per_count is None))
        return _stamps_ns(found) if found.dtype.names else found

    begin, increment = properties.get("wf_start_time"), properties.get("wf_increment")

    def times_ns(start: int, stop: int) -> TimeArray:
        offset_s = float(properties.get("wf_start_offset") or 0.0)
        start_ns = _stamp_ns(begin.seconds, begin.second_fractions) + round(offset_s * NS_PER_S)
        return from_start(start_ns, start, stop, 1.0 / float(increment))

    return Series(
        n_samples=len(channel),
        unit=next((str(properties[p]) for p in _UNIT_PROPERTIES if properties.get(p)), None),
        values=values,
        per_count=per_count,
        times_ns=None if begin is None or not increment else times_ns,
        time_key=tuple(str(properties.get(name)) for name in _WAVEFORM_PROPERTIES),
    )


def _per_count(channel: Any) -> float | None:
    """Return the value of one count of an int16 channel with linear scale through 0; else None."""
    get = channel.properties.get
    linear = get("NI_Number_Of_Scales") == 1 and get(_SCALE + "Scale_Type") == "Linear"
    if not linear or get(_SCALE + "Linear_Y_Intercept") != 0.0:
        return None
    raw = channel.read_data(0, 1, scaled=False)
    slope = get(_SCALE + "Linear_Slope")
    return float(slope) if getattr(raw, "dtype", None) == np.int16 and slope else None


def _require_whole(stream: BinaryIO) -> None:
    """Raise ConfigError if the file is truncated, which npTDMS does not report."""
    size = stream.seek(0, 2)
    at = 0
    while at < size:
        stream.seek(at)
        lead = stream.read(_LEAD.size)
        if len(lead) < _LEAD.size:
            raise ConfigError(f"the file is truncated: the segment at byte {at} is incomplete")
        magic, contents, n_bytes = _LEAD.unpack(lead)
        if contents & _BIG_ENDIAN:  # applies to all fields except the table of contents
            n_bytes = int.from_bytes(n_bytes.to_bytes(8, "little"), "big")
        if magic != b"TDSm":
            raise ConfigError(f"not a TDMS file, or a damaged one: byte {at} begins no segment")
        if n_bytes == _UNFINISHED:
            raise ConfigError(f"the file is unfinished: the segment at byte {at} has no length")
        at += _LEAD.size + n_bytes
    if at > size:
        raise ConfigError(f"the file is truncated: it has {size} bytes, expected {at}")
    stream.seek(0)


def _stamps_ns(stamps: Any) -> npt.NDArray[np.int64]:
    seconds: npt.NDArray[np.int64] = np.asarray(stamps["seconds"]).astype(np.int64) + _EPOCH_1904_S
    if np.any(np.abs(seconds) > 2**33):
        raise ConfigError("a time stamp is after the year 2242; check the clock of the recorder")
    # the upper 53 of 64 bits are exact in a double, a resolution far below the microsecond needed
    us = np.rint((np.asarray(stamps["second_fractions"]) >> np.uint64(11)) * 2.0**-53 * 1e6)
    found: npt.NDArray[np.int64] = seconds * NS_PER_S + us.astype(np.int64) * 1000
    return found


def _stamp_ns(seconds: int, fractions: int) -> int:
    return (seconds + _EPOCH_1904_S) * NS_PER_S + round((fractions >> 11) * 2.0**-53 * NS_PER_S)
