"""CSV files of readings: what is taken, and what is refused with the line."""

from io import BytesIO
from typing import Any

import pytest

from service.cli.offline import backtest_tables as csv_lines
from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_tables import csv_batches


def read(content: str | bytes) -> list[dict[str, Any]]:
    stream = BytesIO(content.encode() if isinstance(content, str) else content)
    return [row for batch, _ in csv_batches(stream) for row in batch.to_pylist()]


def refusal(content: str | bytes) -> str:
    with pytest.raises(ReadingsError) as refused:
        read(content)
    return str(refused.value)


def test_times_with_any_offset_or_in_whole_nanoseconds_are_the_same_moment(text, line):
    rows = read(
        text(
            line(0, time="2025-03-01T08:00:00Z"),
            line(0, time="2025-03-01T09:30:00+01:30"),
            line(0, time="2025-03-01 05:00:00.000-03:00"),
        )
    )
    assert {row["time_ns"] for row in rows[-3:]} == {1_740_816_000_000_000_000}
    nanoseconds = text().replace("time,", "time_ns,", 1).replace("2025-01-01T00:50:00Z", "77")
    with pytest.raises(
        ReadingsError, match="line 2: time_ns is not an integer: '2025-01-01T00:00:00Z"
    ):
        read(nanoseconds)
    head, _, _ = nanoseconds.partition("\n")
    row = "1740816000000000001,U1,UJB,x,1e9,0.01,0.3,40,part_load,good"
    assert read(f"{head}\n{row}\n")[0]["time_ns"] % 10 == 1


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("begin", ["", "\ufeff"])
def test_a_spreadsheet_s_line_ends_mark_and_quotes_do_not_matter(text, end, begin):
    assert read(begin + text().replace("\n", end).replace("U1", '"U1"')) == read(text())


def test_empty_lines_are_no_rows_and_empty_cells_no_numbers(text, line):
    rows = read("\n" + text("", "", line(200, k_n_per_m="", quality="bad")))
    assert [row["line"] for row in rows] == [*range(3, 13), 15]
    assert rows[-1]["k_n_per_m"] != rows[-1]["k_n_per_m"]


def test_pieces_of_a_file_number_their_lines_on(text, line, monkeypatch):
    monkeypatch.setattr(csv_lines, "CHUNK_BYTES", 200)
    lines = [line(100 + n) for n in range(30)]
    assert [row["line"] for row in read(text(*lines))] == list(range(2, 42))
    assert refusal(text(*lines, "", line(200, u_random="much"))).startswith("line 43: ")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"time": "2025-03-01T08:00:00"}, "line 12: time is not ISO 8601 with an offset"),
        ({"time": "2025-13-01T08:00:00Z"}, "line 12: time is not ISO 8601"),
        ({"time": "1740816000"}, "line 12: time is not ISO 8601"),
        ({"time": ""}, "line 12: time is not ISO 8601"),
        ({"time": "2999-01-01T00:00:00Z"}, "line 12: time is not ISO 8601"),
        ({"oil_temperature_c": "warm"}, "line 12: oil_temperature_c is not a number: 'warm'"),
        ({"oil_temperature_c": "0x20"}, "line 12: oil_temperature_c is not a number: '0x20'"),
        ({"oil_temperature_c": "40,5"}, "line 12: expected 10 columns, got 11"),
        ({"unit": ""}, "line 12: unit is missing"),
        ({"unit": "U1\0"}, "line 12: the line contains a NUL byte"),
        ({"unit": '"U1'}, "line 12: a quote is not closed"),
        ({"unit": "U1\rU2"}, "line 12: the line contains a carriage return"),
        ({"unit": "U" * 20_000}, "line 12: the line is longer than 16384 bytes"),
    ],
)
def test_a_wrong_cell_is_named_with_its_line(text, line, changes, says):
    assert refusal(text(line(100, **changes), line(110))).startswith(says)


def test_ten_lines_are_named_the_others_counted_and_other_encodings_refused(text, line):
    assert refusal(text()[:-20]) == "line 11: expected 10 columns, got 8"  # cut off
    said = refusal(text(*(line(n, u_random="x") for n in range(100, 120))))
    assert "line 21: u_random is not a number: 'x'; and 10 more" in said
    assert (
        refusal(text(line(100, unit="Ü")).encode("latin-1"))
        == "line 12: not valid UTF-8; convert the file"
    )
    assert refusal(text().encode("utf-16")) == "line 1: the line contains a NUL byte"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("u_random", "uncertainty", "missing columns: u_random; unknown columns: 'uncertainty'"),
        ("time,", "", "missing columns: time or time_ns"),
        ("state", "quality", "repeated columns: 'quality'"),
        (",unit", ",unit,time_ns", "columns time and time_ns are both given"),
        (",", ";", "line 1: columns must be separated by commas"),
        ("time", '"time', "line 1: a quote is not closed"),
    ],
)
def test_wrong_headings_are_named(text, old, new, says):
    assert says in refusal(text().replace(old, new, -1 if old == "," else 1))


def test_a_file_without_rows_a_huge_heading_and_a_line_without_end_are_refused():
    assert refusal(b"") == refusal(b"\n\r\n") == "the file is empty; expected a heading"
    assert refusal(",".join(f"c{n}" for n in range(1_000_000))) == (
        "line 1: the line is longer than 16384 bytes"
    )
    assert refusal(",".join("a" * 200)) == "expected at most 100 columns, got 200"
    assert refusal(b"x" * 20_000_000) == "line 1: the line is longer than 16384 bytes"
