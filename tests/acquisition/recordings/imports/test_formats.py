"""A run comes back from every format: samples equal, gaps exact, time to a microsecond."""

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import nptdms
import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, CsvLayout, ImportJob, TimeAxis

START_NS = 1_767_225_600_000_000_000
START = datetime(2026, 1, 1, tzinfo=UTC)
PER_COUNT = 12.0 / 32768 * 250.0

Placed = Callable[..., ImportJob]
Change = Callable[[ImportJob], ImportJob]


def write_csv(path: Path, run: Any, samples: np.ndarray) -> None:
    slow = dict(
        zip((run.since_start_s.searchsorted(s) for s in run.slow_s), run.slow_degc, strict=True)
    )
    lines = ["time,shaft x,spare,shaft y,oil"]
    for n, (t, x, y) in enumerate(zip(run.since_start_s, *samples, strict=True)):
        lines.append(f"{t:.6f},{x},,{y},{slow.get(n, '')}")
    path.write_text("\n".join(lines) + "\n")


def write_hdf5(path: Path, run: Any, samples: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        file["waveforms/time"] = run.since_start_s
        file["slow/oil time"] = run.slow_s
        file["slow/oil"] = run.slow_degc
        for name, values in zip(("shaft x", "shaft y"), samples, strict=True):
            dataset = file.create_dataset(f"waveforms/{name}", data=values, chunks=True)
            dataset.attrs["unit"] = "µm"
            if values.dtype == np.int16:
                dataset.attrs["unit_per_count"] = PER_COUNT


def write_tdms(path: Path, run: Any, samples: np.ndarray) -> None:
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": PER_COUNT,
        "NI_Scale[0]_Linear_Y_Intercept": 0.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }
    properties = {"unit_string": "um"} | (scale if samples.dtype == np.int16 else {})
    names = ("shaft x", "shaft y")
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("waveforms", "time", run.since_start_s),
                *(
                    nptdms.ChannelObject("waveforms", name, values, properties)
                    for name, values in zip(names, samples, strict=True)
                ),
                nptdms.ChannelObject("slow", "oil time", run.slow_s),
                nptdms.ChannelObject("slow", "oil", run.slow_degc),
            ]
        )


def linear_conversion() -> Any:
    from asammdf.blocks.v4_blocks import ChannelConversion

    return ChannelConversion(conversion_type=1, a=PER_COUNT, b=0.0)


def write_mdf4(path: Path, run: Any, samples: np.ndarray) -> None:
    import asammdf  # loads pandas, and so do the tests below, not each worker

    counts = samples.dtype == np.int16
    conversion = linear_conversion() if counts else None
    with asammdf.MDF() as mdf:
        mdf.header.start_time = START
        signals = [
            asammdf.Signal(values, run.since_start_s, name=name, unit="um", conversion=conversion)
            for name, values in zip(("shaft x", "shaft y"), samples, strict=True)
        ]
        mdf.append(signals, acq_name="waveforms", common_timebase=True)
        mdf.append(
            asammdf.Signal(run.slow_degc, run.slow_s, name="oil", unit="degC"), acq_name="slow"
        )
        mdf.save(path)


WRITERS = {"csv": write_csv, "hdf5": write_hdf5, "tdms": write_tdms, "mdf4": write_mdf4}


@pytest.fixture
def job_for(job: ImportJob, placed: Placed) -> Callable[[str], ImportJob]:
    """The job that fits the files above."""

    def fitting(kind: str) -> ImportJob:
        if kind == "csv":
            return replace(job, slow=tuple(replace(c, time=None) for c in job.slow))
        grouped = replace(placed(job), format=kind)
        if kind == "mdf4":
            own = replace(grouped.time, kind="file", place=None, start_ns=None)
            slow = tuple(replace(c, time=None) for c in grouped.slow)
            return replace(grouped, time=own, slow=slow)
        return grouped

    return fitting


@pytest.fixture
def imported(tmp_path, run, read, job_for) -> Callable[..., Any]:
    """Writes samples of the run into a file and reads it, by a job that some change."""

    def through(kind: str, samples: np.ndarray, change: Change = lambda job: job) -> Any:
        WRITERS[kind](tmp_path / "run.mf4", run, samples)
        return read(tmp_path / "run.mf4", change(job_for(kind)))

    return through


def with_channels(**changes: Any) -> Change:
    """Change all channels of a job alike."""
    return lambda job: replace(job, channels=tuple(replace(c, **changes) for c in job.channels))


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    ("in_file", "scale", "sample_type"),
    [("units_um", None, "float32"), ("counts", 1.0, "int16"), ("counts", 1.01, "float32")],
    ids=["engineering units", "counts of the calibrated scale", "counts of another scale"],
)
def test_samples_come_back_equal(run, imported, kind, in_file, scale, sample_type):
    """Counts stay counts only where they have the calibrated scale."""
    changes = {"calibrated_per_count": scale * PER_COUNT} if scale else {}
    if scale and (kind == "csv" or scale != 1.0):
        changes["per_count"] = PER_COUNT
    found = imported(kind, getattr(run, in_file), with_channels(**changes))
    due = run.counts * PER_COUNT if scale == 1.01 else getattr(run, in_file)
    assert (found.sample_type, found.samples.dtype) == (sample_type, sample_type)
    np.testing.assert_array_equal(found.samples, due.astype(sample_type))
    assert_times_and_slow_values(found, run)


@pytest.mark.parametrize("kind", ["hdf5", "tdms"])
def test_slow_values_whose_time_goes_back_are_refused(run, imported, monkeypatch, kind):
    monkeypatch.setattr(type(run), "slow_s", np.array([0.0, 2.0, 1.0]))
    with pytest.raises(ConfigError, match="the times of slow channel oil go back"):
        imported(kind, run.units_um)


def assert_times_and_slow_values(found: Any, run: Any) -> None:
    np.testing.assert_array_equal(found.index, run.index)
    for block in found.blocks:
        due_ns = START_NS + math.floor(block.first_index * (1e6 / 600.0)) * 1000
        assert abs(block.start_ns - due_ns) <= 1000
        at_s = (block.start_ns - START_NS) / 1e9
        expected = run.slow_degc[np.searchsorted(run.slow_s, at_s + 1e-9) - 1]
        np.testing.assert_equal(block.side.slow[:, 0], [expected])


@pytest.mark.parametrize("kind", WRITERS)
def test_a_unit_or_a_column_that_is_not_the_mapped_one_is_refused(run, imported, kind):
    group = "" if kind == "csv" else "waveforms"
    with pytest.raises(ConfigError, match="shaft z' does not exist"):
        imported(kind, run.units_um, with_channels(place=ColumnName("shaft z", group)))
    if kind != "csv":  # has units in its headings only
        says = r"'waveforms/shaft x' has unit '(u|µ)m', expected"
        with pytest.raises(ConfigError, match=says):
            imported(kind, run.units_um, with_channels(unit="mm/s"))


def test_a_csv_file_may_have_semicolons_decimal_commas_and_a_preamble(tmp_path, run, read, job):
    write_csv(tmp_path / "run.mf4", run, run.units_um)
    text = (tmp_path / "run.mf4").read_text().replace(",", ";").replace(".", ",")
    (tmp_path / "run.mf4").write_text("Rohdaten;;;\n\n" + text, encoding="utf-8-sig")
    layout = CsvLayout(delimiter=";", decimal=",", header_line=3)
    found = read(tmp_path / "run.mf4", replace(job, csv=layout, slow=()))
    np.testing.assert_array_equal(found.samples, run.units_um)


def test_tdms_waveform_properties_are_its_time(tmp_path, run, read, job, placed):
    properties = {
        "wf_start_time": np.datetime64("2026-01-01T00:00:00.250000"),
        "wf_increment": 1 / 600.0,
        "wf_start_offset": 0.0,
    }
    with nptdms.TdmsWriter(tmp_path / "run.mf4") as file:
        for _ in range(2):  # two segments follow each other
            file.write_segment(
                [
                    nptdms.ChannelObject("waveforms", f"shaft {axis}", values[:500], properties)
                    for axis, values in zip("xy", run.units_um, strict=True)
                ]
            )
    axis = TimeAxis("file", 0)
    found = read(tmp_path / "run.mf4", replace(placed(job), format="tdms", time=axis, slow=()))
    np.testing.assert_array_equal(found.index, np.arange(1000))
    np.testing.assert_array_equal(found.samples[:, 500:], run.units_um[:, :500])
    assert found.blocks[0].start_ns == START_NS + 250_000_000
    assert found.blocks[1].start_ns == START_NS + 250_000_000 + 83_333_000


def test_local_time_in_an_mdf_file_is_read_in_the_zone_of_the_mapping(tmp_path, run, read, job_for):
    import asammdf

    write_mdf4(tmp_path / "run.mf4", run, run.units_um)
    with asammdf.MDF(tmp_path / "run.mf4") as mdf:
        mdf.header.start_time = datetime(2026, 1, 1)
        mdf.save(tmp_path / "local.mf4")
    job = job_for("mdf4")
    found = read(tmp_path / "local.mf4", replace(job, time=replace(job.time, utc_offset_s=-10800)))
    assert found.blocks[0].start_ns == START_NS + 10_800 * 10**9


@pytest.mark.parametrize("of", ["counts", "units_um"])
def test_samples_that_an_mdf_file_calls_invalid_are_none(tmp_path, run, read, job_for, of):
    import asammdf

    invalid = np.isin(run.index, (0, 7, 600))
    values, conversion = getattr(run, of), linear_conversion() if of == "counts" else None
    with asammdf.MDF() as mdf:
        signals = [
            asammdf.Signal(channel, run.since_start_s, name=f"shaft {axis}", conversion=conversion)
            for axis, channel in zip("xy", values, strict=True)
        ]
        signals[0].invalidation_bits = invalid
        mdf.append(signals, acq_name="waveforms", common_timebase=True)
        mdf.save(tmp_path / "run.mf4")
    found = read(tmp_path / "run.mf4", replace(job_for("mdf4"), slow=()))
    due = (values * PER_COUNT if of == "counts" else values).astype(np.float32)
    due[0, invalid] = np.nan
    np.testing.assert_array_equal(found.samples, due)
    np.testing.assert_array_equal(found.index, run.index)


def test_waveforms_of_different_lengths_or_times_are_refused(tmp_path, run, read, job):
    import asammdf

    with h5py.File(tmp_path / "run.mf4", "w") as file:
        file["time"] = run.since_start_s
        file["shaft x"], file["shaft y"] = run.units_um[0], run.units_um[1, :-1]
    with pytest.raises(
        ConfigError, match="'shaft y' has 1262 samples, but column 'shaft x' has 1263"
    ):
        read(tmp_path / "run.mf4", replace(job, format="hdf5", slow=()))
    with asammdf.MDF() as mdf:
        for axis, delay_s, values in zip("xy", (0.0, 0.0005), run.units_um, strict=True):
            mdf.append(asammdf.Signal(values, run.since_start_s + delay_s, name=f"shaft {axis}"))
        mdf.save(tmp_path / "two.mf4")
    own = TimeAxis("file", 0)
    with pytest.raises(ConfigError, match="'shaft y' and 'shaft x' differ in their times"):
        read(tmp_path / "two.mf4", replace(job, format="mdf4", time=own, slow=()))
