"""An HDF5 file that is damaged, or means harm, ends in one sentence and in bounded memory."""

import zlib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from rigs.hostile_files import Read, measured, refusal, write_hdf5

from acquisition.importing.job import ImportJob


@pytest.fixture
def hdf5_job(job: ImportJob) -> ImportJob:
    return replace(job, format="hdf5", slow=())


def test_hdf5_links_to_elsewhere_are_not_followed(
    tmp_path: Path, read: Read, hdf5_job: ImportJob
) -> None:
    write_hdf5(tmp_path / "other")
    write_hdf5(tmp_path / "external", shaft_x=h5py.ExternalLink("other", "/shaft x"))
    assert "'shaft x' is a link to elsewhere" in refusal(read, tmp_path / "external", hdf5_job)
    write_hdf5(tmp_path / "soft", shaft_x=h5py.SoftLink("/shaft y"))
    assert "'shaft x' is a link to elsewhere" in refusal(read, tmp_path / "soft", hdf5_job)


def test_hdf5_values_in_other_files_are_not_read(
    tmp_path: Path, read: Read, hdf5_job: ImportJob
) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(bytes(800))
    with h5py.File(tmp_path / "external", "w") as file:
        file["time"] = file["shaft y"] = np.arange(100) / 600.0
        file.create_dataset("shaft x", (100,), "f8", external=[(str(secret), 0, 800)])
    says = "dataset 'shaft x' has its values in another file"
    assert says in refusal(read, tmp_path / "external", hdf5_job)
    write_hdf5(tmp_path / "other")
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other"), "shaft x", (100,))
    with h5py.File(tmp_path / "virtual", "w") as file:
        file["time"] = file["shaft y"] = np.arange(100) / 600.0
        file.create_virtual_dataset("shaft x", layout)
    assert says in refusal(read, tmp_path / "virtual", hdf5_job)


@pytest.mark.parametrize("chunks", [None, (30,)])
def test_hdf5_values_that_nobody_has_written_are_not_zeros(
    tmp_path: Path, read: Read, hdf5_job: ImportJob, chunks: tuple[int, ...] | None
) -> None:
    with h5py.File(tmp_path / "run", "w") as file:
        file["time"] = file["shaft x"] = np.arange(100) / 600.0
        begun = file.create_dataset("shaft y", (100,), "f4", chunks=chunks)
        if chunks:
            begun[:90] = 1.0
    says = refusal(read, tmp_path / "run", hdf5_job)
    assert "dataset 'shaft y' is longer than what was written of it" in says


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros((100, 2)), "has shape (100, 2) of float64"),
        (np.array([b"a"] * 100), "has shape (100,) of |S1"),
        (np.zeros(100, np.complex128), "has shape (100,) of complex128"),
        (np.zeros(0), "0 samples, column"),
    ],
    ids=["matrix", "text", "complex", "empty"],
)
def test_hdf5_values_that_are_no_numbers_in_a_row_are_refused(
    tmp_path: Path, read: Read, hdf5_job: ImportJob, values: np.ndarray, words: str
) -> None:
    write_hdf5(tmp_path / "run", shaft_y=values)
    assert words in refusal(read, tmp_path / "run", hdf5_job)


def test_hdf5_of_declared_and_packed_gigabytes_is_refused_in_little_memory(
    tmp_path: Path, hdf5_job: ImportJob
) -> None:
    packed = zlib.compress(bytes(2**20), 1)
    with h5py.File(tmp_path / "declared", "w") as file:
        for name in ("time", "shaft x", "shaft y"):
            made = file.create_dataset(name, (2**30,), "i1", chunks=(2**25,), compression="gzip")
            for n in range(32):
                made.id.write_direct_chunk((n * 2**25,), packed)
    with h5py.File(tmp_path / "packed", "w") as file:
        for name in ("time", "shaft x", "shaft y"):
            n_rows = 2**29 - 1
            made = file.create_dataset(name, (n_rows,), "f4", chunks=(n_rows,), compression="gzip")
            made.id.write_direct_chunk((0,), packed)
    own_mb, child_mb, said = measured(hdf5_job, tmp_path / "declared", tmp_path / "packed")
    assert "1073741824 samples per channel; 1 to 536870912 can be read" in said[0]
    assert "'shaft x' has chunks of 2147483644 bytes; up to 67108864 can be read" in said[1]
    assert max(own_mb, child_mb) < 200
