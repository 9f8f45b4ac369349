"""What the cells of a CSV file say is read as it is meant, or refused."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from rigs.hostile_files import Read

from acquisition.errors import ConfigError
from acquisition.importing.job import CsvLayout, ImportJob, Place, TimeAxis

START_NS = 1_767_225_600_000_000_000


def test_thousands_are_not_taken_for_decimals(tmp_path: Path, read: Read, job: ImportJob) -> None:
    (tmp_path / "run.mf4").write_text("time;shaft x;shaft y\n0;1.234;2\n")
    german = replace(job, csv=CsvLayout(delimiter=";", decimal=","), slow=())
    with pytest.raises(ConfigError, match=r"line 2: .*'\.' in number '1\.234'"):
        read(tmp_path / "run.mf4", german)


@pytest.mark.parametrize("year", ["9999", "2256", "1600", "0001"])
def test_a_year_that_no_clock_can_have_had_is_refused(
    tmp_path: Path, read: Read, job: ImportJob, year: str
) -> None:
    (tmp_path / "run.mf4").write_text(f"time,shaft x,shaft y\n{year}-12-31T00:00:00,1,2\n")
    axis = TimeAxis("column", 0, Place("time"), "iso8601")
    with pytest.raises(ConfigError, match=r"a time of .* s since 1970 is none"):
        read(tmp_path / "run.mf4", replace(job, time=axis, slow=()))


@pytest.mark.parametrize(
    ("form", "of"),
    [
        ("epoch_s", lambda us: f"{us / 1e6:.6f}"),
        ("epoch_ms", lambda us: f"{us / 1e3:.3f}"),
        ("epoch_us", str),
        ("epoch_ns", lambda us: str(us * 1000)),
        ("iso8601", lambda us: f"{datetime.fromtimestamp(us / 1e6, UTC):%Y-%m-%d %H:%M:%S.%f}"),
        ("iso8601", lambda us: f"{datetime.fromtimestamp(us / 1e6, UTC).isoformat()}"),
    ],
)
@pytest.mark.parametrize("offset_h", [0, -3])
def test_time_zones_are_those_of_the_text_or_else_of_the_mapping(
    tmp_path: Path, read: Read, job: ImportJob, form: Any, of: Callable[[int], str], offset_h: int
) -> None:
    stamps = [START_NS // 1000 + n * 10**6 // 600 for n in range(60)]
    rows = "".join(f"{of(us)},1,2\n" for us in stamps)
    (tmp_path / "run.mf4").write_text("time,shaft x,shaft y\n" + rows)
    axis = TimeAxis("column", offset_h * 3600, Place("time"), form)
    found = read(tmp_path / "run.mf4", replace(job, time=axis, slow=()))
    has_zone = "+00:00" in rows
    expected_ns = START_NS - (0 if has_zone else offset_h * 3600 * 10**9)
    assert [b.start_ns for b in found.blocks] == [expected_ns, expected_ns + 83_333_000]


def test_a_unit_in_a_heading_must_be_the_mapped_one(
    tmp_path: Path, read: Read, job: ImportJob
) -> None:
    (tmp_path / "run").write_text("time,shaft x [mm],shaft y [South]\n0,1,2\n")
    names = ("shaft x [mm]", "shaft y [South]")
    channels = tuple(replace(c, place=Place(n)) for c, n in zip(job.channels, names, strict=True))
    with pytest.raises(ConfigError, match=r"'shaft x \[mm\]' is in 'mm', the mapping says 'um'"):
        read(tmp_path / "run", replace(job, channels=channels, slow=()))
    channels = (replace(channels[0], unit="mm", factor=1000.0), channels[1])
    found = read(tmp_path / "run", replace(job, channels=channels, slow=()))
    assert found.samples.tolist() == [[1000.0], [2.0]]
