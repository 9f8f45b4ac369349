"""TDMS files of LabVIEW and its relatives: channels in groups."""

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName
from acquisition.recordings.imports.series import SeriesFile, require_one
from acquisition.recordings.imports.times import TimeArray, from_start, library

_EPOCH_1904_S = -2_082_844_800
_UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")
_SCALE = "NI_Scale[0]_"

_LEAD = struct.Struct("<4sL4xQ8x")
"""Of a segment: magic, table of contents; bytes that follow. Source: NI, TDMS file format."""

_BIG_ENDIAN = 1 << 6
_UNFINISHED = 2**64 - 1


class TdmsFile(SeriesFile):
    """A name is group and channel; time of its own is that of the waveform properties."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        # an open file, not a path: npTDMS would use an index file beside it
        self._stream = path.open("rb")
        _require_whole(self._stream)
        self._file = library("nptdms", "TDMS").TdmsFile.open(self._stream, raw_timestamps=True)

    def _find(self, place: ColumnName) -> "_TdmsSeries":
        channels = [
            channel
            for group in self._file.groups()
            if place.group in ("", group.name)
            for channel in group.channels()
            if channel.name == place.name
        ]
        return _TdmsSeries(require_one(channels, place, self._names()), place)

    def _names(self) -> list[str]:
        return [f"{g.name}/{c.name}" for g in self._file.groups() for c in g.channels()[:12]][:12]


class _TdmsSeries:
    def __init__(self, channel: Any, place: ColumnName) -> None:
        self._channel, self._place = channel, place
        self._properties = channel.properties
        self.n_samples = len(channel)
        found = (self._properties.get(name) for name in _UNIT_PROPERTIES)
        self.unit: str | None = next((str(unit) for unit in found if unit), None)
        self.per_count: float | None = self._per_count()
        waveform = ("wf_start_time", "wf_increment", "wf_start_offset")
        self.time_key: object = tuple(str(self._properties.get(name)) for name in waveform)

    def values(self, start: int, stop: int) -> npt.NDArray[Any]:
        raw = self.per_count is not None
        found = self._channel.read_data(start, stop - start, scaled=not raw)
        if getattr(found, "dtype", None) is not None and found.dtype.names:
            return _stamps_ns(found)
        return np.asarray(found)

    def times_ns(self, start: int, stop: int) -> TimeArray:
        begin, increment = (
            self._properties.get("wf_start_time"),
            self._properties.get("wf_increment"),
        )
        if begin is None or not increment:
            raise ConfigError(
                f"channel {str(self._place)[:200]!r} has no wf_start_time and wf_increment: name a"
                " time column or a start"
            )
        offset_s = float(self._properties.get("wf_start_offset") or 0.0)
        start_ns = _stamp_ns(begin.seconds, begin.second_fractions) + round(offset_s * 1e9)
        return from_start(start_ns, start, stop, 1.0 / float(increment))

    def _per_count(self) -> float | None:
        """Of counts with one linear scale through zero, which is all that a converter needs."""
        get = self._properties.get
        linear = get("NI_Number_Of_Scales") == 1 and get(_SCALE + "Scale_Type") == "Linear"
        if not linear or get(_SCALE + "Linear_Y_Intercept") != 0.0:
            return None
        raw = self._channel.read_data(0, 1, scaled=False)
        slope = get(_SCALE + "Linear_Slope")
        return float(slope) if getattr(raw, "dtype", None) == np.int16 and slope else None


def _require_whole(stream: BinaryIO) -> None:
    """Refuse a file that does not end where its last segment does; npTDMS would read the rest."""
    size = stream.seek(0, 2)
    at = 0
    while at < size:
        stream.seek(at)
        lead = stream.read(_LEAD.size)
        if len(lead) < _LEAD.size:
            raise ConfigError(f"cut off within the segment at {at}")
        magic, contents, n_bytes = _LEAD.unpack(lead)
        if contents & _BIG_ENDIAN:  # of all but the table of contents itself
            n_bytes = int.from_bytes(n_bytes.to_bytes(8, "little"), "big")
        if magic != b"TDSm":
            raise ConfigError(f"no TDMS file, or damaged: there is no segment at {at}")
        if n_bytes == _UNFINISHED:
            raise ConfigError("whatever wrote it has not finished its last segment")
        at += _LEAD.size + n_bytes
    if at > size:
        raise ConfigError(f"cut off: its last segment ends at {at}, the file at {size}")
    stream.seek(0)


def _stamps_ns(stamps: Any) -> npt.NDArray[np.int64]:
    seconds: npt.NDArray[np.int64] = np.asarray(stamps["seconds"]).astype(np.int64) + _EPOCH_1904_S
    if np.any(np.abs(seconds) > 2**33):
        raise ConfigError("a time stamp beyond the year 2242")
    # the upper 53 bits of 64 are exact in a double, and a thousand times finer than is needed
    us = np.rint((np.asarray(stamps["second_fractions"]) >> np.uint64(11)) * 2.0**-53 * 1e6)
    found: npt.NDArray[np.int64] = seconds * 1_000_000_000 + us.astype(np.int64) * 1000
    return found


def _stamp_ns(seconds: int, fractions: int) -> int:
    return (seconds + _EPOCH_1904_S) * 1_000_000_000 + round((fractions >> 11) * 2.0**-53 * 1e9)
