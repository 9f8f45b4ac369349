"""A recording into one file for another tool, whole or not at all."""

import os
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recording.export.arrow import CsvExporter, ParquetExporter
from acquisition.recording.export.hdf5 import Hdf5Exporter
from acquisition.recording.export.mdf4 import Mdf4Exporter
from acquisition.recording.export.rows import Exporter, export_rows
from acquisition.recording.export.tdms import TdmsExporter
from acquisition.recording.manifest import Manifest
from acquisition.recording.reader import Recording
from acquisition.recording.tables import foreign_errors_of


class ExportFormat(StrEnum):
    """What a recording can be exported as."""

    CSV = "csv"
    HDF5 = "hdf5"
    MDF4 = "mdf4"
    PARQUET = "parquet"
    TDMS = "tdms"


_EXPORTERS: dict[ExportFormat, Callable[[Path, Manifest], Exporter]] = {
    ExportFormat.CSV: CsvExporter,
    ExportFormat.HDF5: Hdf5Exporter,
    ExportFormat.MDF4: Mdf4Exporter,
    ExportFormat.PARQUET: ParquetExporter,
    ExportFormat.TDMS: TdmsExporter,
}


def export_recording(
    recording: Recording,
    kind: ExportFormat,
    out: Path,
    advanced: Callable[[int], None] = lambda _: None,
) -> None:
    """Write a recording as a file of another format.

    Parameters
    ----------
    out
        Must not exist yet.
    advanced
        Told how many samples per channel have been written since it was last called.

    Raises
    ------
    ConfigError
        If the file exists or cannot be written, the format's library is not installed, or the
        recording cannot be read; nothing is left behind then.
    """
    if os.path.lexists(out):
        raise ConfigError(f"{out}: is there already; nothing is overwritten")
    aside = out.with_name(out.name + ".incomplete")
    try:
        with foreign_errors_of(out):
            _export(recording, _EXPORTERS[kind](aside, recording.manifest), advanced)
            aside.rename(out)
    finally:
        with suppress(FileNotFoundError):
            aside.unlink()


def _export(recording: Recording, exporter: Exporter, advanced: Callable[[int], None]) -> None:
    try:
        for rows in export_rows(recording):
            exporter.write(rows)
            advanced(len(rows.index))
    finally:
        exporter.close()
