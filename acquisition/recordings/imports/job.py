"""`ImportJob`: mapping of the columns of a file to channels, and time axis of the file."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from core.samples.calibration import (
    BLOCK_SAMPLES,
    UNLIMITED,
    SlowCalibration,
    UnitCalibration,
)

Format: TypeAlias = Literal["mdf4", "tdms", "hdf5", "csv", "candump", "blf"]
TimeKind: TypeAlias = Literal["file", "column", "start"]


@dataclass(frozen=True)
class ColumnName:
    """Name of a column in a file.

    Parameters
    ----------
    name
        Heading of a CSV column, path of an HDF5 dataset, name of an MDF or TDMS channel.
    group
        Group of a TDMS channel; name or number of an MDF channel group. Empty if the name is
        unique.
    """

    name: str
    group: str = ""

    def __str__(self) -> str:
        return f"{self.group}/{self.name}" if self.group else self.name


@dataclass(frozen=True)
class TimeAxis:
    """Time axis of a file.

    Parameters
    ----------
    kind
        Source of the times. "file": provided by the file format. "column": a time column. "start":
        a start time and the sampling rate of the unit, without gaps.
    place
        Time column for kind "column"; None without a time column.
    form
        Content of a time column: text ("iso8601"), time stamps of the file format ("timestamp"), or
        numbers since 1970 ("epoch_s") or since the start ("elapsed_s"), in s, ms, us or ns.
    start_ns
        Start time, UTC in ns; None if the file states it.
    utc_offset_s
        Local time minus UTC in s, for times without a time zone.
    tolerance
        Maximum deviation of a stamp from a constant sampling rate, in samples.
    """

    kind: TimeKind
    utc_offset_s: int
    place: ColumnName | None = None
    form: str = "elapsed_s"
    start_ns: int | None = None
    tolerance: float = 0.4


@dataclass(frozen=True)
class Column:
    """Column of a channel; `factor` is the channel's unit of measurement per `unit` of the file."""

    id: str
    place: ColumnName
    unit: str
    factor: float


@dataclass(frozen=True)
class ChannelColumn(Column):
    """Column of a waveform channel.

    Parameters
    ----------
    calibrated_per_count
        Engineering units per count in the calibration of the channel; only counts with this scale
        are imported as counts.
    per_count
        Value of one count in the unit of the file, for counts whose scale the file does not state.
    """

    calibrated_per_count: float
    per_count: float | None = None


@dataclass(frozen=True)
class SlowColumn(Column):
    """Column of a slow channel: value = factor × value in the file + offset.

    `time` is a time column of its own, in the form of the time axis; None for the waveform times.
    """

    offset: float = 0.0
    time: ColumnName | None = None


@dataclass(frozen=True)
class CsvLayout:
    """Format of a CSV file.

    `header_line` is the number of the line with the headings, from 1; earlier lines are skipped.
    """

    delimiter: str = ","
    decimal: str = "."
    header_line: int = 1


@dataclass(frozen=True)
class ImportJob:
    """Description of a file to import: format, time axis and columns of the channels.

    Parameters
    ----------
    rate_hz
        Sampling rate of the unit.
    channels
        Columns of the waveform channels, in the order of the unit.
    slow
        Columns of the slow channels, in the order of the unit.
    block_samples
        Number of samples that share one OK state per channel and one set of slow values.
    bus
        Bus to read from a CAN log; empty for a log of a single bus.
    """

    format: Format
    rate_hz: float
    time: TimeAxis
    channels: tuple[ChannelColumn, ...] = ()
    slow: tuple[SlowColumn, ...] = ()
    block_samples: int = BLOCK_SAMPLES
    csv: CsvLayout = CsvLayout()
    bus: str = ""

    @property
    def calibration(self) -> UnitCalibration:
        """Calibration of the imported blocks, without unit id, gains and limits."""
        slow = tuple(SlowCalibration(column.id, -math.inf, math.inf) for column in self.slow)
        channels = (UNLIMITED,) * len(self.channels)
        return UnitCalibration("", self.rate_hz, channels, slow, self.block_samples)
