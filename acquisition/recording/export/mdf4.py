"""MDF version 4: groups of waveforms and of slow channels, each with its time channel."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.extras import library
from acquisition.recording.export.rows import UNITS, ExportRows, require_free_names
from acquisition.recording.manifest import Manifest

WAVEFORMS, SLOW = "waveforms", "slow"
_OWN = ("time", "epoch", "index")


class Mdf4Exporter:
    """Times are seconds since the start that the header has, in UTC."""

    def __init__(self, path: Path, manifest: Manifest) -> None:
        require_free_names([c.id for c in manifest.channels], _OWN)
        require_free_names([c.id for c in manifest.slow_channels], _OWN[:1])
        self._asammdf = library("asammdf", "MDF4")
        self._path, self._manifest = path, manifest
        self._mdf = self._asammdf.MDF(version="4.10")
        self._start_ns: int | None = None

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        slow_times = rows.times_ns[rows.block_rows]
        waveforms = [rows.epochs, rows.index, *rows.samples]
        if self._start_ns is None:
            self._begin(int(rows.times_ns[0]))
            self._append(WAVEFORMS, self._waveform_names(), rows.times_ns, waveforms)
            if len(rows.slow):
                names = [(c.id, c.unit) for c in self._manifest.slow_channels]
                self._append(SLOW, names, slow_times, list(rows.slow))
        else:
            self._extend(0, rows.times_ns, waveforms)
            if len(rows.slow):
                self._extend(1, slow_times, list(rows.slow))

    def close(self) -> None:
        """Finish the file."""
        saved = Path(self._mdf.save(self._path, overwrite=True))
        self._mdf.close()
        if saved != self._path:  # asammdf gives every file its own ending
            saved.replace(self._path)

    def _begin(self, start_ns: int) -> None:
        self._start_ns = start_ns
        start = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start_ns // 1000)
        self._mdf.header.start_time = start
        self._mdf.header.abs_time = start_ns  # a datetime went through seconds in a double
        self._mdf.header.comment = f"unit {self._manifest.unit}, made by {self._manifest.made_by}"

    def _waveform_names(self) -> list[tuple[str, str]]:
        waveforms = [(c.id, UNITS[c.measurand]) for c in self._manifest.channels]
        return [("epoch", ""), ("index", ""), *waveforms]

    def _append(
        self, group: str, names: list[tuple[str, str]], times_ns: np.ndarray, columns: list[Any]
    ) -> None:
        signals = [
            self._asammdf.Signal(values, self._since_start_s(times_ns), name=name, unit=unit)
            for (name, unit), values in zip(names, columns, strict=True)
        ]
        self._mdf.append(signals, acq_name=group, comment=group, common_timebase=True)

    def _extend(self, group: int, times_ns: np.ndarray, columns: list[Any]) -> None:
        parts = [self._since_start_s(times_ns), *columns]
        self._mdf.extend(group, [(np.ascontiguousarray(part), None) for part in parts])

    def _since_start_s(self, times_ns: np.ndarray) -> np.ndarray:
        return np.asarray((times_ns - (self._start_ns or 0)) / 1e9)
