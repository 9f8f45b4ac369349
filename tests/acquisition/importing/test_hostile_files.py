"""A file that is damaged, or means harm, ends in one sentence and in bounded memory."""

import pickle
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import nptdms
import numpy as np
import pytest
from rigs.hostile_files import Placed, Read, measured, refusal

from acquisition.importing.job import ImportJob, Place, TimeAxis


@pytest.fixture
def csv_job(job: ImportJob) -> ImportJob:
    return replace(job, slow=())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "column 'shaft x' is not there"),
        (b"time,shaft x,shaft y\n0,1,2\n0.001,\x00,2\n", "line 3: has a NUL byte"),
        (b"time,shaft x,shaft y\n0,1,2\n1,2\n", "line 3: 2 columns where the header has 3"),
        (b"time,shaft x,shaft y\n0,1,2,3\n", "line 2: 4 columns where the header has 3"),
        (b"time,shaft x,shaft y\n" + b"0" * 5_000_000, "line 2: longer than 1000000 bytes"),
        (b"a" * 5_000_000, "line 1: longer than 1000000 bytes"),
        (b"time,shaft x,shaft y\n0,eleven,2\n", "no number 'eleven'"),
        (b"time,shaft x,shaft y\n0,=1+1,2\n", "no number '=1+1'"),
        (b"time,shaft x,shaft y\nnan,1,2\n", "nan in the time column is no time"),
        (b"time,shaft x,shaft y\n1e300,1,2\n", "in the time column is no time"),
        (b"time,shaft x,shaft y\n9007199254,1,2\n", "a time of 1.07744e+10 s since 1970 is none"),
        (b"time,shaft x,shaft y\n0,1_000,2\n", "line 2: or one of those before it: '_' in number"),
        (b"time,shaft x,shaft x\n0,1,2\n", "column 'shaft x' is there 2 times"),
        (b"time,shaft x,shaft y\n\xff\xfe,1,2\n", "line 2: not UTF-8 text"),
        (b'time,shaft x,shaft y\n"0,1,2\n' * 2, "line 4: "),
        (b'time,shaft x,shaft y\n"' + b"0,1,2\n" * 50_000, "field larger than field limit"),
        (b"x," * 400_000 + b"\n", "400001 columns; at most 4096 are read"),
    ],
    ids=range(17),
)
def test_wrong_text_is_refused_naming_the_line(
    tmp_path: Path, read: Read, csv_job: ImportJob, content: bytes, words: str
) -> None:
    (tmp_path / "run").write_bytes(content)
    says = refusal(read, tmp_path / "run", csv_job)
    assert words in says
    assert "not readable as" not in says


def test_a_file_that_is_none_is_refused(tmp_path: Path, read: Read, csv_job: ImportJob) -> None:
    assert "No such file" in refusal(read, tmp_path / "absent", csv_job)
    assert "not a regular file" in refusal(read, tmp_path, csv_job)


@pytest.mark.long
def test_a_million_columns_are_refused_or_read_in_bounded_memory(
    tmp_path: Path, job: ImportJob, placed: Placed
) -> None:
    names = [f"channel {n}" for n in range(1_000_000)]
    segment = b"".join(
        struct.pack("<I", len(path)) + path + struct.pack("<II", 0xFFFFFFFF, 0)
        for path in (f"/'g'/'{name}'".encode() for name in names)
    )
    meta = struct.pack("<I", len(names)) + segment
    lead = b"TDSm" + struct.pack("<IIQQ", 0x6, 4713, len(meta), len(meta))
    (tmp_path / "run.tdms").write_bytes(lead + meta)
    tdms_job = replace(placed(job), format="tdms", slow=())
    own_mb, child_mb, (said,) = measured(tdms_job, tmp_path / "run.tdms")
    assert "is not there" in said or "needs more than 2 GiB" in said
    assert own_mb < 200
    assert child_mb < 2200


def test_objects_that_were_pickled_are_never_loaded(
    tmp_path: Path, read: Read, job: ImportJob
) -> None:
    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "harmed",))

    (tmp_path / "run").write_bytes(pickle.dumps(Evil()))
    for kind in ("csv", "hdf5", "tdms", "mdf4", "candump", "blf"):
        assert refusal(read, tmp_path / "run", replace(job, format=kind))
    array = np.array([Evil()], dtype=object)
    np.save(tmp_path / "run.npy", array, allow_pickle=True)
    for kind in ("csv", "hdf5", "tdms", "mdf4", "blf"):
        assert refusal(read, tmp_path / "run.npy", replace(job, format=kind))
    assert not (tmp_path / "harmed").exists()


def test_an_archive_is_not_unpacked(tmp_path: Path, read: Read, job: ImportJob) -> None:
    with zipfile.ZipFile(tmp_path / "run.mf4", "w") as archive:
        archive.writestr("../../escaped.mf4", b"MDF     4.10    " + bytes(100))
    says = refusal(read, tmp_path / "run.mf4", replace(job, format="mdf4"))
    assert "not an MDF file of version 4" in says
    assert [path.name for path in tmp_path.iterdir()] == ["run.mf4"]


@pytest.mark.usefixtures("confined")
def test_a_reader_that_crashes_is_a_refusal(tmp_path: Path, read: Read, job: ImportJob) -> None:
    lead = b"TDSm" + struct.pack("<IIQQ", 0x2, 4713, 72, 72)
    (tmp_path / "run").write_bytes(lead + struct.pack("<II", 1, 64) + b"\xff" * 64)
    says = refusal(read, tmp_path / "run", replace(job, format="tdms", slow=()))
    assert ": not readable as tdms: " in says


def test_places_in_groups_are_told_apart(tmp_path: Path, read: Read, job: ImportJob) -> None:
    with nptdms.TdmsWriter(tmp_path / "run") as file:
        for group in ("a", "b"):
            file.write_segment([nptdms.ChannelObject(group, "shaft x", np.zeros(5))])
    one = replace(job.channels[0], place=Place("shaft x"))
    start = TimeAxis("start", 0, start_ns=0)
    both = replace(job, format="tdms", channels=(one,), slow=(), time=start)
    assert "'shaft x' is there 2 times: name its group" in refusal(read, tmp_path / "run", both)
