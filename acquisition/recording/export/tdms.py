"""TDMS: groups of waveforms and of slow channels, each with its times."""

from pathlib import Path
from typing import Any

import numpy as np

from acquisition.extras import library
from acquisition.recording.export.rows import UNITS, ExportRows, require_free_names
from acquisition.recording.manifest import Manifest

WAVEFORMS, SLOW = "waveforms", "slow"
_OWN = ("time_utc", "epoch", "index")


class TdmsExporter:
    """Channel ``time_utc`` of both groups has time stamps, which TDMS keeps in UTC."""

    def __init__(self, path: Path, manifest: Manifest) -> None:
        require_free_names([c.id for c in manifest.channels], _OWN)
        require_free_names([c.id for c in manifest.slow_channels], _OWN[:1])
        self._nptdms = library("nptdms", "TDMS")
        self._manifest = manifest
        self._writer = self._nptdms.TdmsWriter(path)
        self._writer.open()
        root = {"unit": manifest.unit, "rate_hz": manifest.rate_hz, "made_by": manifest.made_by}
        self._writer.write_segment([self._nptdms.RootObject(root)])

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        slow_times = rows.times_ns[rows.block_rows]
        waveforms = zip(self._manifest.channels, rows.samples, strict=True)
        slow = zip(self._manifest.slow_channels, rows.slow, strict=True)
        self._writer.write_segment(
            [
                self._channel(WAVEFORMS, "time_utc", _stamps(rows.times_ns)),
                self._channel(WAVEFORMS, "epoch", rows.epochs),
                self._channel(WAVEFORMS, "index", rows.index),
                *(self._channel(WAVEFORMS, c.id, v, UNITS[c.measurand]) for c, v in waveforms),
                self._channel(SLOW, "time_utc", _stamps(slow_times)),
                *(self._channel(SLOW, c.id, v, c.unit) for c, v in slow),
            ]
        )

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()

    def _channel(self, group: str, name: str, values: np.ndarray, unit: str = "") -> Any:
        properties = {"unit_string": unit} if unit else {}
        return self._nptdms.ChannelObject(group, name, np.ascontiguousarray(values), properties)


def _stamps(times_ns: np.ndarray) -> np.ndarray:
    return (times_ns // 1000).astype("datetime64[us]")
