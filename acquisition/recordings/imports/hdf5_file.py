"""Reader of HDF5 files: one-dimensional datasets stored in the file itself."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName
from acquisition.recordings.imports.series import Series, SeriesFile
from acquisition.recordings.imports.times import library

UNIT_ATTRIBUTES = ("unit", "units")
PER_COUNT_ATTRIBUTE = "unit_per_count"

_MAX_CHUNK_BYTES = 2**26
"""Maximum size of a chunk; HDF5 decompresses whole chunks to read any of their values."""


def hdf5_file(path: Path) -> SeriesFile:
    """Open an HDF5 file; columns are named by dataset path, with units in dataset attributes.

    Raises `ConfigError` if h5py is not installed.
    """
    h5py = library("h5py", "HDF5")
    file = h5py.File(path, "r")

    def find(place: ColumnName) -> Series:
        at, parts = file, [part for part in str(place).split("/") if part]
        for n, part in enumerate(parts):
            link = at.get(part, getlink=True) if isinstance(at, h5py.Group) else None
            if link is None:
                raise ConfigError(f"dataset {str(place)[:200]!r} does not exist")
            if not isinstance(link, h5py.HardLink):
                words = "is a soft or external link; only hard links are followed"
                raise ConfigError(f"{'/'.join(parts[: n + 1])[:200]!r} {words}")
            at = at[part]
        if not isinstance(at, h5py.Dataset):
            raise ConfigError(f"{str(place)[:200]!r} is not a dataset")
        _require_plain(at, place)
        return _series(at)

    return SeriesFile(find)


def _require_plain(dataset: Any, place: ColumnName) -> None:
    n_bytes = math.prod(dataset.chunks or ()) * dataset.dtype.itemsize
    words = ""
    if dataset.is_virtual or dataset.external:
        words = "has its values in another file, which is not read"
    elif n_bytes > _MAX_CHUNK_BYTES:
        words = f"has chunks of {n_bytes} bytes; the maximum is {_MAX_CHUNK_BYTES}"
    elif len(dataset.shape or ()) != 1 or dataset.dtype.kind not in "iuf":
        shape = f"shape {dataset.shape} of {dataset.dtype}"
        words = f"has {shape}; expected one dimension of numbers"
    elif not _is_written(dataset):
        words = "is incomplete: some of its chunks have not been written"
    if words:
        raise ConfigError(f"dataset {str(place)[:200]!r} {words}")


def _is_written(dataset: Any) -> bool:
    """Return whether all values were written; HDF5 returns a fill value for unwritten ones."""
    if dataset.chunks is None:
        return bool(dataset.size == 0 or dataset.id.get_storage_size())
    return bool(dataset.id.get_num_chunks() * dataset.chunks[0] >= dataset.shape[0])


def _series(dataset: Any) -> Series:
    attributes = dataset.attrs
    gain = attributes.get(PER_COUNT_ATTRIBUTE)
    unit = next((attributes[name] for name in UNIT_ATTRIBUTES if name in attributes), None)
    return Series(
        n_samples=int(dataset.shape[0]),
        unit=unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit and str(unit),
        values=lambda start, stop: dataset[start:stop],
        per_count=float(gain) if isinstance(gain, float | np.floating) else None,
    )
