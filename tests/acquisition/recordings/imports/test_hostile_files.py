"""A file that is damaged, or means harm, ends in one sentence and in bounded memory."""

import pickle
import struct
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import h5py
import nptdms
import numpy as np
import pytest
from rigs.hostile_files import measured, refusal, write_hdf5

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, ImportJob, TimeAxis
from acquisition.recordings.reading import imported_frames


@pytest.fixture
def csv_job(job: ImportJob) -> ImportJob:
    return replace(job, slow=())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "column 'shaft x' does not exist"),
        (b"time,shaft x,shaft y\n0,1,2\n0.001,\x00,2\n", "line 3: the line contains a NUL byte"),
        (b"time,shaft x,shaft y\n0,1,2\n1,2\n", "line 3: expected 3 columns, got 2"),
        (b"time,shaft x,shaft y\n0,1,2,3\n", "line 2: expected 3 columns, got 4"),
        (
            b"time,shaft x,shaft y\n" + b"0" * 5_000_000,
            "line 2: the line is longer than 1000000 bytes",
        ),
        (b"a" * 5_000_000, "line 1: the line is longer than 1000000 bytes"),
        (b"time,shaft x,shaft y\n0,eleven,2\n", "'eleven' is not a valid number"),
        (b"time,shaft x,shaft y\n0,=1+1,2\n", "'=1+1' is not a valid number"),
        (b"time,shaft x,shaft y\nnan,1,2\n", "value nan of the time column is not a valid time"),
        (b"time,shaft x,shaft y\n1e300,1,2\n", "of the time column is not a valid time"),
        (b"time,shaft x,shaft y\n9007199254,1,2\n", "time 1.07744e+10 s since 1970 is out of"),
        (b"time,shaft x,shaft y\n0,1_000,2\n", "line 2: number '1_000'"),
        (b"time,shaft x,shaft x\n0,1,2\n", "column 'shaft x' occurs 2 times"),
        (b"time,shaft x,shaft y\n\xff\xfe,1,2\n", "line 2: the line is not valid UTF-8"),
        (b'time,shaft x,shaft y\n"0,1,2\n' * 2, "line 4: "),
        (b'time,shaft x,shaft y\n"' + b"0,1,2\n" * 50_000, "field larger than field limit"),
        (b"x," * 400_000 + b"\n", "at most 4096 columns, got 400001"),
    ],
    ids=range(17),
)
def test_wrong_text_is_refused_naming_the_line(tmp_path, read, csv_job, content, words):
    (tmp_path / "run").write_bytes(content)
    says = refusal(read, tmp_path / "run", csv_job)
    assert words in says
    assert "not readable as" not in says


def test_a_file_that_is_none_is_refused(tmp_path, read, csv_job):
    assert "No such file" in refusal(read, tmp_path / "absent", csv_job)
    assert "not a regular file" in refusal(read, tmp_path, csv_job)


@pytest.mark.long
def test_a_million_columns_are_refused_or_read_in_bounded_memory(tmp_path, job, placed):
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
    assert "does not exist" in said or "requires more than 2048 MiB" in said
    assert own_mb < 200
    assert child_mb < 2200


def test_objects_that_were_pickled_are_never_loaded(tmp_path, read, job):
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


def test_an_archive_is_not_unpacked(tmp_path, read, job):
    with zipfile.ZipFile(tmp_path / "run.mf4", "w") as archive:
        archive.writestr("../../escaped.mf4", b"MDF     4.10    " + bytes(100))
    says = refusal(read, tmp_path / "run.mf4", replace(job, format="mdf4"))
    assert "not a finished MDF file of version 4" in says
    assert [path.name for path in tmp_path.iterdir()] == ["run.mf4"]


def test_a_reader_that_crashes_is_a_refusal(tmp_path, read, job):
    lead = b"TDSm" + struct.pack("<IIQQ", 0x2, 4713, 72, 72)
    (tmp_path / "run").write_bytes(lead + struct.pack("<II", 1, 64) + b"\xff" * 64)
    says = refusal(read, tmp_path / "run", replace(job, format="tdms", slow=()))
    assert ": cannot be read as tdms: " in says


def test_places_in_groups_are_told_apart(tmp_path, read, job):
    with nptdms.TdmsWriter(tmp_path / "run") as file:
        for group in ("a", "b"):
            file.write_segment([nptdms.ChannelObject(group, "shaft x", np.zeros(5))])
    one = replace(job.channels[0], place=ColumnName("shaft x"))
    start = TimeAxis("start", 0, start_ns=0)
    both = replace(job, format="tdms", channels=(one,), slow=(), time=start)
    assert "'shaft x' occurs 2 times; name its group" in refusal(read, tmp_path / "run", both)


@pytest.fixture
def hdf5_job(job: ImportJob) -> ImportJob:
    return replace(job, format="hdf5", slow=())


def test_hdf5_links_to_elsewhere_are_not_followed(tmp_path, read, hdf5_job):
    write_hdf5(tmp_path / "other")
    write_hdf5(tmp_path / "external", shaft_x=h5py.ExternalLink("other", "/shaft x"))
    assert "'shaft x' is a soft or external link" in refusal(read, tmp_path / "external", hdf5_job)
    write_hdf5(tmp_path / "soft", shaft_x=h5py.SoftLink("/shaft y"))
    assert "'shaft x' is a soft or external link" in refusal(read, tmp_path / "soft", hdf5_job)


def test_hdf5_that_has_no_such_dataset_is_refused(tmp_path, read, hdf5_job):
    path = tmp_path / "run"
    with h5py.File(path, "w") as file:
        file.create_group("shaft x")
    assert "'shaft x' is not a dataset" in refusal(read, path, hdf5_job)
    absent = replace(hdf5_job.channels[0], place=ColumnName("shaft x/y"))
    says = refusal(read, path, replace(hdf5_job, channels=(absent,)))
    assert "dataset 'shaft x/y' does not exist" in says


def test_a_file_without_times_of_its_own_says_what_to_name(tmp_path, read, hdf5_job):
    own_times = replace(hdf5_job, time=TimeAxis("file", 0))
    says = "column 'shaft x' has no times in the file; name a time column or a start"
    write_hdf5(tmp_path / "run.h5")
    assert says in refusal(read, tmp_path / "run.h5", own_times)
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as file:
        for name in ("shaft x", "shaft y"):
            file.write_segment([nptdms.ChannelObject("a", name, np.zeros(5))])
    assert says in refusal(read, tmp_path / "run.tdms", replace(own_times, format="tdms"))


def test_tdms_that_is_unfinished_or_no_tdms_is_refused(tmp_path, read, job):
    tdms_job, path = replace(job, format="tdms", slow=()), tmp_path / "run"
    path.write_bytes(b"TDSm" + struct.pack("<IIQQ", 0x2, 4713, 2**64 - 1, 0))
    assert "the file is unfinished" in refusal(read, path, tdms_job)
    path.write_bytes(b"RIFF" + bytes(40))
    assert "not a TDMS file, or a damaged one: byte 0" in refusal(read, path, tdms_job)
    path.write_bytes(b"TDSm" + struct.pack("<IIQQ", 0x2, 4713, 100, 0))
    says = "the file is truncated: it has 28 bytes, expected 128"
    assert says in refusal(read, path, tdms_job)
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject("a", "shaft y", np.zeros(5))])
    assert "'shaft x' does not exist; the file has a/shaft y" in refusal(read, path, tdms_job)


def test_hdf5_values_in_other_files_are_not_read(tmp_path, read, hdf5_job):
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
def test_hdf5_values_that_nobody_has_written_are_not_zeros(tmp_path, read, hdf5_job, chunks):
    with h5py.File(tmp_path / "run", "w") as file:
        file["time"] = file["shaft x"] = np.arange(100) / 600.0
        begun = file.create_dataset("shaft y", (100,), "f4", chunks=chunks)
        if chunks:
            begun[:90] = 1.0
    says = refusal(read, tmp_path / "run", hdf5_job)
    assert "dataset 'shaft y' is incomplete" in says


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros((100, 2)), "(100, 2) of float64; expected one dimension of numbers"),
        (np.array([b"a"] * 100), "has shape (100,) of |S1"),
        (np.zeros(100, np.complex128), "has shape (100,) of complex128"),
        (np.zeros(0), "0 samples, but column"),
    ],
    ids=["matrix", "text", "complex", "empty"],
)
def test_hdf5_values_that_are_no_numbers_in_a_row_are_refused(
    tmp_path, read, hdf5_job, values, words
):
    write_hdf5(tmp_path / "run", shaft_y=values)
    assert words in refusal(read, tmp_path / "run", hdf5_job)


def test_hdf5_of_declared_and_packed_gigabytes_is_refused_in_little_memory(tmp_path, hdf5_job):
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
    assert "1 to 536870912 samples per channel, got 1073741824" in said[0]
    assert "'shaft x' has chunks of 2147483644 bytes; the maximum is 67108864" in said[1]
    assert max(own_mb, child_mb) < 200


HEADER = 144
OBJECT = struct.Struct("<4sHHLL")
CONTAINER = struct.Struct("<H6xL4x")


@pytest.fixture
def blf_job(job: ImportJob) -> ImportJob:
    return replace(job, format="blf", time=TimeAxis("file", 0), channels=(), slow=())


@pytest.fixture
def objects(tmp_path: Path) -> bytes:
    """A hundred frames, as they are in a container."""
    with can.BLFWriter(tmp_path / "sound", compression_level=0) as log:
        for n in range(100):
            log(can.Message(timestamp=1e9 + n, arbitration_id=1, data=bytes(8)))
    return (tmp_path / "sound").read_bytes()[HEADER + OBJECT.size + CONTAINER.size :]


def container(content: bytes, *, method: int = 0, n_bytes: int | None = None) -> bytes:
    size = OBJECT.size + CONTAINER.size + len(content)
    unpacked = len(content) if n_bytes is None else n_bytes
    head = OBJECT.pack(b"LOBJ", OBJECT.size, 1, size, 10) + CONTAINER.pack(method, unpacked)
    return head + content + bytes(size % 4)


def write(path: Path, content: bytes, n_objects: int = 100, n_bytes: int | None = None) -> None:
    size = HEADER + len(content) if n_bytes is None else n_bytes
    head = struct.pack("<4sL8xQQL", b"LOGG", HEADER, size, size, n_objects)
    path.write_bytes(head.ljust(HEADER, b"\0") + content)


def n_frames(path: Path, job: ImportJob) -> int:
    return sum(len(batch) for batch, _ in imported_frames(path, job))


def changed(objects: bytes, number: int, at: int, value: int) -> bytes:
    """One of the objects with another number in its head."""
    place = number * len(objects) // 100 + at
    return objects[:place] + struct.pack("<H", value) + objects[place + 2 :]


def test_objects_may_go_on_in_the_next_container(tmp_path, blf_job, objects):
    packed = zlib.compress(objects[1001:])
    both = container(objects[:1001]) + container(packed, method=2, n_bytes=len(objects) - 1001)
    write(tmp_path / "run", both)
    assert n_frames(tmp_path / "run", blf_job) == 100


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lambda o: container(changed(o, 50, 8, 0)), "an object has length 0"),  # for ever
        (lambda o: container(changed(o, 50, 8, 60000)), "ends within an object"),
        (lambda o: container(changed(o, 50, 6, 3)), "Unknown object header version"),
        (lambda o: container(changed(o, 50, 12, 7)[: len(o) // 2]), "50 objects, expected"),
        (lambda o: container(o[:-20]), "truncated: it ends within an object"),
        (lambda o: container(o[:96] + bytes(40) + o[96:]), "Could not find next object"),
        (lambda o: container(zlib.compress(o), method=1), "Unknown compression method"),
        (lambda o: container(zlib.compress(o)[:-9], method=2, n_bytes=len(o)), "within an object"),
        (lambda _: container(b"\xff" * 99, method=2, n_bytes=9), "incorrect header check"),
        (lambda o: o, "0 objects, expected 100"),
        (lambda _: OBJECT.pack(b"LOBJ", 16, 1, 20, 10) + bytes(4), "unpack_from requires a buffer"),
    ],
    ids=range(11),
)
def test_a_log_of_which_anything_is_missing_is_refused(tmp_path, blf_job, objects, content, words):
    write(tmp_path / "run", content(objects))
    with pytest.raises(ConfigError, match=words):
        n_frames(tmp_path / "run", blf_job)


def test_a_log_that_was_not_finished_is_refused(tmp_path, blf_job, objects):
    write(tmp_path / "run", container(objects), n_objects=0, n_bytes=HEADER)
    with pytest.raises(ConfigError, match=r"144 according to its header; it is truncated"):
        n_frames(tmp_path / "run", blf_job)


def test_a_container_that_unpacks_to_gigabytes_is_refused_in_little_memory(tmp_path, blf_job):
    packer = zlib.compressobj(1)
    block = packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = block + 255 * block[2:]  # without the head of the stream
    declared, packed_more = tmp_path / "declared", tmp_path / "packed"
    write(declared, container(packed, method=2, n_bytes=2**32 - 1))
    write(packed_more, container(packed, method=2, n_bytes=1000))
    own_mb, child_mb, said = measured(blf_job, declared, packed_more)
    assert all("requires more than 256 MiB of memory" in words for words in said)
    assert own_mb < 250
    assert child_mb < 500
