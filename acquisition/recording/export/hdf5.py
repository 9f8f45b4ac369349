"""HDF5: a dataset for each channel, with its unit as an attribute."""

from pathlib import Path
from typing import Any

import numpy as np

from acquisition.extras import library
from acquisition.recording.export.rows import UNITS, ExportRows, require_free_names
from acquisition.recording.manifest import Manifest

_CHUNK = 8192
_OWN = ("time_ns", "epoch", "index")


class Hdf5Exporter:
    """Datasets ``time_ns``, ``epoch``, ``index`` and one for each waveform channel.

    In group ``slow`` are the slow channels with the times of their blocks. Times are nanoseconds
    since 1970, UTC.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        require_free_names([c.id for c in manifest.channels], (*_OWN, "slow"))
        require_free_names([c.id for c in manifest.slow_channels], _OWN[:1])
        self._file = library("h5py", "HDF5").File(path, "w")
        self._file.attrs.update(
            unit=manifest.unit, rate_hz=manifest.rate_hz, made_by=manifest.made_by
        )
        self._rows = [self._dataset(name, "i8", "") for name in _OWN]
        self._samples = [self._dataset(c.id, "f4", UNITS[c.measurand]) for c in manifest.channels]
        self._slow_time = self._dataset("slow/time_ns", "i8", "")
        self._slow = [self._dataset(f"slow/{c.id}", "f8", c.unit) for c in manifest.slow_channels]

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        columns = [rows.times_ns, rows.epochs, rows.index, *rows.samples]
        for dataset, values in zip([*self._rows, *self._samples], columns, strict=True):
            _append(dataset, values)
        _append(self._slow_time, rows.times_ns[rows.block_rows])
        for dataset, values in zip(self._slow, rows.slow, strict=True):
            _append(dataset, values)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()

    def _dataset(self, name: str, dtype: str, unit: str) -> Any:
        made = self._file.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(_CHUNK,))
        if unit:
            made.attrs["unit"] = unit
        return made


def _append(dataset: Any, values: np.ndarray) -> None:
    start = dataset.shape[0]
    dataset.resize((start + len(values),))
    dataset[start:] = values
