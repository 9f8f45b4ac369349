"""HDF5 files: datasets of one dimension, in this very file."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName
from acquisition.recordings.imports.series import SeriesFile
from acquisition.recordings.imports.times import TimeArray, library

UNIT_ATTRIBUTES = ("unit", "units")
PER_COUNT_ATTRIBUTE = "unit_per_count"

_MAX_CHUNK_BYTES = 2**26
"""HDF5 unpacks whole chunks, however few of their values are asked for."""


class Hdf5File(SeriesFile):
    """A name is the path of a dataset; its unit is its attribute ``unit`` or ``units``."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._h5py = library("h5py", "HDF5")
        self._file = self._h5py.File(path, "r")

    def _find(self, place: ColumnName) -> "_Hdf5Series":
        return _Hdf5Series(self._dataset(place))

    def _dataset(self, place: ColumnName) -> Any:
        at, parts = self._file, [part for part in str(place).split("/") if part]
        for n, part in enumerate(parts):
            link = at.get(part, getlink=True) if isinstance(at, self._h5py.Group) else None
            if link is None:
                raise ConfigError(f"dataset {str(place)[:200]!r} is not there")
            if not isinstance(link, self._h5py.HardLink):
                raise ConfigError(
                    f"{'/'.join(parts[: n + 1])[:200]!r} is a link to elsewhere; it is not followed"
                )
            at = at[part]
        return self._plain(at, place)

    def _plain(self, dataset: Any, place: ColumnName) -> Any:
        if not isinstance(dataset, self._h5py.Dataset):
            raise ConfigError(f"{str(place)[:200]!r} is no dataset")
        if dataset.is_virtual or dataset.external:
            raise ConfigError(f"dataset {str(place)[:200]!r} has its values in another file")
        n_bytes = math.prod(dataset.chunks or ()) * dataset.dtype.itemsize
        if n_bytes > _MAX_CHUNK_BYTES:
            raise ConfigError(
                f"dataset {str(place)[:200]!r} has chunks of {n_bytes} bytes; up to"
                f" {_MAX_CHUNK_BYTES} can be read"
            )
        if len(dataset.shape or ()) != 1 or dataset.dtype.kind not in "iuf":
            raise ConfigError(
                f"dataset {str(place)[:200]!r} has shape {dataset.shape} of {dataset.dtype};"
                " needed is one dimension of numbers"
            )
        if not self._is_written(dataset):
            raise ConfigError(
                f"dataset {str(place)[:200]!r} is longer than what was written of it: whatever"
                " wrote it has not finished"
            )
        return dataset

    def _is_written(self, dataset: Any) -> bool:
        """Whether all values were written; HDF5 returns a fill value for the others."""
        if dataset.chunks is None:
            return bool(dataset.size == 0 or dataset.id.get_storage_size())
        return bool(dataset.id.get_num_chunks() * dataset.chunks[0] >= dataset.shape[0])


class _Hdf5Series:
    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset
        self.n_samples = int(dataset.shape[0])
        self.unit: str | None = next(
            (_text(dataset.attrs[a]) for a in UNIT_ATTRIBUTES if a in dataset.attrs), None
        )
        gain = dataset.attrs.get(PER_COUNT_ATTRIBUTE)
        self.per_count: float | None = (
            float(gain) if isinstance(gain, float | np.floating) else None
        )
        self.time_key: object = None

    def values(self, start: int, stop: int) -> npt.NDArray[Any]:
        found: npt.NDArray[Any] = self._dataset[start:stop]
        return found

    def times_ns(self, start: int, stop: int) -> TimeArray:
        raise ConfigError(
            f"HDF5 has no time of its own for samples {start} to {stop}: name a time column or"
            " a start"
        )


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
