"""Cells of a CSV file are read as meant or refused; time stamps become indices, gaps exact."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from rigs.tiers import first_fast

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ColumnName, CsvLayout, TimeAxis
from acquisition.recordings.imports.rows import Indexer, Stretch

START_NS = 1_767_225_600_000_000_000


def test_thousands_are_not_taken_for_decimals(read_text):
    german = CsvLayout(delimiter=";", decimal=",")
    with pytest.raises(ConfigError, match=r"line 2: number '1\.234' contains '\.'"):
        read_text("time;shaft x;shaft y\n0;1.234;2\n", csv=german)


@pytest.mark.parametrize("cell", ["2086,4888", "x"])
@pytest.mark.parametrize("column", [1, 2])
def test_a_wrong_number_is_reported_with_its_line(read_text, cell, column):
    cells = [["0", "1", "2"] for _ in range(100)]
    cells[30][column] = cell
    text = "\n".join(["time;shaft x;shaft y", *(";".join(row) for row in cells), ""])
    with pytest.raises(ConfigError, match=f"line 32: '{cell}' is not a valid number") as refused:
        read_text(text, csv=CsvLayout(delimiter=";"))
    assert ('set csv.decimal = ","' in str(refused.value)) == ("," in cell)


@pytest.mark.parametrize("year", ["9999", "2256", "1600", "0001"])
def test_a_year_that_no_clock_can_have_had_is_refused(read_text, year):
    axis = TimeAxis("column", 0, ColumnName("time"), "iso8601")
    with pytest.raises(ConfigError, match=r"time .* s since 1970 is out of range"):
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
def test_time_zones_are_those_of_the_text_or_else_of_the_mapping(read_text, form, of, offset_h):
    stamps = [START_NS // 1000 + n * 10**6 // 600 for n in range(60)]
    rows = "".join(f"{of(us)},1,2\n" for us in stamps)
    axis = TimeAxis("column", offset_h * 3600, ColumnName("time"), form)
    found = read_text("time,shaft x,shaft y\n" + rows, time=axis)
    has_zone = "+00:00" in rows
    expected_ns = START_NS - (0 if has_zone else offset_h * 3600 * 10**9)
    assert [b.start_ns for b in found.blocks] == [expected_ns, expected_ns + 83_333_000]


def test_a_unit_in_a_heading_must_be_the_mapped_one(read_text, job):
    text = "time,shaft x [mm],shaft y [South]\n0,1,2\n"
    names = ("shaft x [mm]", "shaft y [South]")
    channels = tuple(
        replace(c, place=ColumnName(n)) for c, n in zip(job.channels, names, strict=True)
    )
    with pytest.raises(ConfigError, match=r"'shaft x \[mm\]' has unit 'mm', expected 'um'"):
        read_text(text, channels=channels)
    channels = (replace(channels[0], unit="mm", factor=1000.0), channels[1])
    found = read_text(text, channels=channels)
    assert found.samples.tolist() == [[1000.0], [2.0]]


def stamps(index: np.ndarray, rate_hz: float = 600.0, step_ns: int = 1000) -> np.ndarray:
    """Of samples, as a clock of limited resolution gives them."""
    return START_NS + np.asarray(index * 1e9 / rate_hz, dtype=np.int64) // step_ns * step_ns


def found_index(times_ns: np.ndarray, chunk: int = 100_000, rate_hz: float = 600.0) -> np.ndarray:
    """Epoch and index of every row."""
    indexer, found = Indexer(rate_hz, 0.4), []
    for start in range(0, len(times_ns), chunk):
        for s in indexer.stretches(times_ns[start : start + chunk]):
            index = s.first_index + np.arange(s.stop - s.start)
            found.append(np.stack([np.full_like(index, s.epoch), index]))
    return np.concatenate(found, axis=1)


@pytest.mark.parametrize(
    ("rate_hz", "step_ns"),
    [(50.0, 10**6), (600.0, 1), (600.0, 1000), (600.0, 10**6), (640.0, 10**6), (25_600.0, 1000)],
)
@pytest.mark.parametrize("chunk", first_fast(1, [7777, 1000]))
def test_every_gap_is_exact_whatever_the_resolution(rate_hz, step_ns, chunk):
    chance = np.random.default_rng(3)
    missing = np.zeros(20_000, np.int64)
    gaps = chance.choice(np.arange(1, 20_000), 2000, replace=False)
    missing[gaps] = chance.choice([1, 2, 3, 10, 1000], 2000)
    index = np.arange(20_000) + missing.cumsum()
    epoch, found = found_index(stamps(index, rate_hz, step_ns), chunk, rate_hz)
    np.testing.assert_array_equal(found, index)
    assert not epoch.any()


@pytest.mark.parametrize("ppm", [-300, 50, 300])
def test_a_clock_that_runs_a_little_wrong_makes_no_gaps(ppm):
    index = np.arange(200_000)
    _, found = found_index(stamps(index, 600.0 * (1 + ppm * 1e-6)))
    np.testing.assert_array_equal(found, index)


def test_a_pause_of_no_whole_number_of_samples_is_a_restart():
    times_ns = stamps(np.arange(1000.0))
    times_ns[600:] += 10_000_833_333
    epoch, found = found_index(times_ns)
    np.testing.assert_array_equal(epoch, np.arange(1000) >= 600)
    np.testing.assert_array_equal(found, [*range(600), *range(400)])


@pytest.mark.parametrize(
    "rate_hz", [150.0, 300.0, 400.0, 450.0, 500.0, 590.0, 601.0, 800.0, 1200.0]
)
def test_another_rate_is_refused_naming_both_and_never_taken_for_gaps(rate_hz):
    words = rf"expected samples at 600 Hz, found about {rate_hz:.6g}"
    with pytest.raises(ConfigError, match=words[:-1]):
        found_index(stamps(np.arange(20_000), rate_hz, 1))


def test_a_rate_that_changes_on_the_way_is_refused():
    first = stamps(np.arange(10_000))
    rest = first[-1] + stamps(np.arange(1, 5000), 300.0) - START_NS
    with pytest.raises(ConfigError, match="found about 300 Hz"):
        found_index(np.concatenate([first, rest]))


def test_time_that_goes_back_or_stands_still_is_refused():
    times_ns = stamps(np.arange(1000))
    times_ns[700:] -= 10**9
    with pytest.raises(ConfigError, match=r"row 701: times must .* is 599 sampling periods before"):
        found_index(times_ns)
    times_ns = stamps(np.arange(1000))
    times_ns[700:] = np.roll(times_ns[700:], 1)
    times_ns[700] = times_ns[699]
    with pytest.raises(ConfigError, match=r"row 701: times must .* is 0 sampling periods before"):
        found_index(times_ns)


def test_a_stamp_off_its_place_is_refused():
    with pytest.raises(ConfigError, match="time stamp deviates"):  # too coarse for the rate
        found_index(stamps(np.arange(20_000), 900.0, 10**6), rate_hz=900.0)
    times_ns = stamps(np.arange(1000))
    times_ns[500] += 800_000
    with pytest.raises(ConfigError, match=r"row 501: the time stamp deviates by \+0\.480"):
        found_index(times_ns)


def test_rows_in_pieces_are_the_rows_in_one():
    times_ns = stamps(np.array([0, 1, 2, 5, 6, 700, 701]))
    indexer = Indexer(600.0, 0.4)
    assert [s for t in times_ns for s in indexer.stretches(np.array([t]))] == [
        Stretch(0, 1, 0, n) for n in (0, 1, 2, 5, 6, 700, 701)
    ]
