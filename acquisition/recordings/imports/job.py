"""`ImportJob`: columns of the channels of a file, and its time axis."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from core.samples.calibration import BLOCK_SAMPLES

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
    """Times of the samples of a file.

    Parameters
    ----------
    kind
        "file": times of the format itself. "column": a time column. "start": from a given time on
        at the unit's rate, without a gap.
    form
        What a column has: text ("iso8601"), the format's own stamps ("timestamp"), or numbers since
        1970 ("epoch_s") or since the start ("elapsed_s"), in s, ms, us or ns.
    start_ns
        Start in UTC; None if the file has it.
    utc_offset_s
        Local time minus UTC, for times without a time zone.
    tolerance
        How far a stamp may be from its place at the unit's rate, in samples.
    """

    kind: TimeKind
    utc_offset_s: int
    place: ColumnName | None = None
    form: str = "elapsed_s"
    start_ns: int | None = None
    tolerance: float = 0.4


@dataclass(frozen=True)
class ChannelColumn:
    """A waveform channel.

    Parameters
    ----------
    unit
        Of the values in the file.
    factor
        Engineering unit of the channel per unit of the file.
    calibrated_per_count
        Engineering units per count by the channel's calibration: only counts of just this scale
        are taken over as counts.
    per_count
        The file's unit per count, if the column has counts and the file does not state it.
    """

    id: str
    place: ColumnName
    unit: str
    factor: float
    calibrated_per_count: float
    per_count: float | None = None


@dataclass(frozen=True)
class SlowColumn:
    """A slow channel: value = factor × what the file has + offset.

    Parameters
    ----------
    time
        Its own time column, of the same form as that of the waveforms; None for their time.
    """

    id: str
    place: ColumnName
    unit: str
    factor: float
    offset: float = 0.0
    time: ColumnName | None = None


@dataclass(frozen=True)
class CsvLayout:
    """Format of a CSV file.

    Parameters
    ----------
    header_line
        Number of the line with the headings, counted from 1; what is before it is skipped.
    """

    delimiter: str = ","
    decimal: str = "."
    header_line: int = 1


@dataclass(frozen=True)
class ImportJob:
    """Description of a file for its reader.

    Parameters
    ----------
    rate_hz, block_samples
        Of the unit: see :class:`core.samples.calibration.UnitCalibration`.
    channels, slow
        In the order of the unit.
    bus
        Bus to read from a CAN log of several; empty if the log must be of one.
    """

    format: Format
    rate_hz: float
    time: TimeAxis
    channels: tuple[ChannelColumn, ...] = ()
    slow: tuple[SlowColumn, ...] = ()
    block_samples: int = BLOCK_SAMPLES
    csv: CsvLayout = CsvLayout()
    bus: str = ""
