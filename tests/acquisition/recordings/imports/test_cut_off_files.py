"""A file that was cut off or damaged is refused: no rest is missed, no half of a number read."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import h5py
import nptdms
import numpy as np
import pytest
from rigs.tiers import first_fast

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob, TimeAxis
from acquisition.recordings.reading import imported_blocks, imported_frames

SINCE_S = np.arange(600) / 600.0
NAMES = ("time", "shaft x", "shaft y")


def write_csv(path: Path) -> None:
    rows = "".join(f"{t:.6f},{n}.125,{1000 + n}\n" for n, t in enumerate(SINCE_S))
    path.write_text(",".join(NAMES) + "\n" + rows)


def write_tdms(path: Path) -> None:
    with nptdms.TdmsWriter(path) as file:
        for part in np.split(SINCE_S, 3):
            file.write_segment([nptdms.ChannelObject("g", name, part) for name in NAMES])


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in NAMES:
            file.create_dataset(name, data=SINCE_S, chunks=(100,), compression="gzip")


def write_mdf4(path: Path, compression: int = 0) -> None:
    import asammdf  # loads pandas, not in each worker

    with asammdf.MDF() as mdf:
        signals = [asammdf.Signal(SINCE_S, SINCE_S, name=name) for name in NAMES[1:]]
        mdf.append(signals, common_timebase=True)
        mdf.save(path, compression=compression)


def write_frames(log: Any) -> None:
    for n in range(600):
        log(can.Message(timestamp=1e9 + n, arbitration_id=n, is_fd=n % 2 == 0, data=bytes(8)))


def write_candump(path: Path) -> None:
    with can.CanutilsLogWriter(path) as log:
        write_frames(log)


def write_blf(path: Path, level: int = -1) -> None:
    with can.BLFWriter(path, compression_level=level, max_container_size=4000) as log:
        write_frames(log)


WRITERS: dict[str, Callable[[Path], None]] = {
    "csv": write_csv,
    "tdms": write_tdms,
    "hdf5": write_hdf5,
    "mdf4": write_mdf4,
    "mdf4 packed": lambda path: write_mdf4(path, 2),
    "candump": write_candump,
    "blf": write_blf,
    "blf not packed": lambda path: write_blf(path, 0),
}


@pytest.fixture
def job_for(job: ImportJob) -> Callable[[str], ImportJob]:
    def of(kind: str) -> ImportJob:
        fitting = replace(job, format=kind.split()[0], slow=())
        if fitting.format in ("csv", "tdms", "hdf5"):
            return fitting
        channels = () if fitting.format in ("candump", "blf") else job.channels
        return replace(fitting, time=TimeAxis("file", 0), channels=channels)

    return of


def read_all(path: Path, job: ImportJob) -> int:
    if job.channels:
        return sum(block.n_samples for block, _ in imported_blocks(path, job))
    return sum(len(batch) for batch, _ in imported_frames(path, job))


@pytest.mark.parametrize("sevenths", first_fast(1, [(4,), (1, 6)]))
@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_that_was_cut_off_anywhere_is_refused(tmp_path, job_for, kind, sevenths):
    path, job = tmp_path / "run.mf4", job_for(kind)
    WRITERS[kind](path)
    content = path.read_bytes()
    assert read_all(path, job) == 600
    for length in (len(content) - 2, *(len(content) * n // 7 for n in sevenths)):
        path.write_bytes(content[: length - (content[length - 1 : length] == b"\n")])
        with pytest.raises(ConfigError) as error:
            read_all(path, job)
        assert str(error.value).startswith(f"{path}: ")
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", ["tdms", "blf"])
def test_parts_that_are_missing_at_the_end_are_noticed_at_their_border_too(tmp_path, job_for, kind):
    path, job = tmp_path / "run", job_for(kind)
    WRITERS[kind](path)
    content = path.read_bytes()
    mark = {"tdms": b"TDSm", "blf": b"LOBJ"}[kind]
    path.write_bytes(content[: content.rindex(mark) + (10 if kind == "tdms" else 0)])
    with pytest.raises(
        ConfigError, match=r"the file is truncated|bytes, but .* according to its header"
    ):
        read_all(path, job)


@pytest.mark.parametrize("n_damaged", first_fast(1, [2, 8]))
@pytest.mark.parametrize("kind", ["tdms", "mdf4", "blf", "hdf5"])
def test_any_damage_is_read_or_refused_but_never_more(tmp_path, job_for, kind, n_damaged):
    """Cut off anywhere, and bytes changed at random: the reading process may do what it likes."""
    path, job = tmp_path / "run.mf4", job_for(kind)
    WRITERS[kind](path)
    content, chance = path.read_bytes(), random.Random(7)  # noqa: S311  not a secret
    n_refused = 0
    for n in range(n_damaged):
        damaged = bytearray(content)
        if n % 3 == 0:
            damaged = damaged[: chance.randrange(len(damaged))]
        else:
            for _ in range(chance.randint(1, 30)):
                damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        path.write_bytes(damaged)
        try:
            read_all(path, job)
        except ConfigError as error:
            n_refused += 1
            assert str(error).startswith(str(path))  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017
    assert n_refused > 0


def test_an_index_file_beside_a_tdms_file_is_not_believed(tmp_path, job_for):
    write_tdms(tmp_path / "run.tdms")
    (tmp_path / "run.tdms_index").write_bytes(b"TDSh" + bytes(100))
    assert read_all(tmp_path / "run.tdms", job_for("tdms")) == 600
