"""What the cells of a CSV file say is read as it is meant, or refused."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from acquisition.errors import ConfigError
from acquisition.importing.job import CsvLayout, ImportJob, Place, TimeAxis

ReadText = Callable[..., Any]
START_NS = 1_767_225_600_000_000_000


def test_thousands_are_not_taken_for_decimals(read_text: ReadText) -> None:
    german = CsvLayout(delimiter=";", decimal=",")
    with pytest.raises(ConfigError, match=r"line 2: .*'\.' in number '1\.234'"):
        read_text("time;shaft x;shaft y\n0;1.234;2\n", csv=german)


@pytest.mark.parametrize("year", ["9999", "2256", "1600", "0001"])
def test_a_year_that_no_clock_can_have_had_is_refused(read_text: ReadText, year: str) -> None:
    axis = TimeAxis("column", 0, Place("time"), "iso8601")
    with pytest.raises(ConfigError, match=r"a time of .* s since 1970 is none"):
        read_text(f"time,shaft x,shaft y\n{year}-12-31T00:00:00,1,2\n", time=axis)


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
    read_text: ReadText, form: Any, of: Callable[[int], str], offset_h: int
) -> None:
    stamps = [START_NS // 1000 + n * 10**6 // 600 for n in range(60)]
    rows = "".join(f"{of(us)},1,2\n" for us in stamps)
    axis = TimeAxis("column", offset_h * 3600, Place("time"), form)
    found = read_text("time,shaft x,shaft y\n" + rows, time=axis)
    has_zone = "+00:00" in rows
    expected_ns = START_NS - (0 if has_zone else offset_h * 3600 * 10**9)
    assert [b.start_ns for b in found.blocks] == [expected_ns, expected_ns + 83_333_000]


def test_a_unit_in_a_heading_must_be_the_mapped_one(read_text: ReadText, job: ImportJob) -> None:
    text = "time,shaft x [mm],shaft y [South]\n0,1,2\n"
    names = ("shaft x [mm]", "shaft y [South]")
    channels = tuple(replace(c, place=Place(n)) for c, n in zip(job.channels, names, strict=True))
    with pytest.raises(ConfigError, match=r"'shaft x \[mm\]' is in 'mm', the mapping says 'um'"):
        read_text(text, channels=channels)
    channels = (replace(channels[0], unit="mm", factor=1000.0), channels[1])
    found = read_text(text, channels=channels)
    assert found.samples.tolist() == [[1000.0], [2.0]]
