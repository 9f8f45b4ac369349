from pathlib import Path

import numpy as np
import pytest

from core.transducer_response import HighPass, ResponseTable
from service.settings.calibration_sheet import SheetError, read_calibration_sheet

HEADER = "frequency_hz,magnitude,phase_deg\n"
GOOD_LINES = HEADER + "0.1,0.2,78\n1,0.89,26.5\n10,1.0,3\n"


def sheet(folder: Path, text: str) -> Path:
    path = folder / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        GOOD_LINES,
        "\ufeff" + GOOD_LINES.replace("\n", "\r\n"),
        "# calibrated 2026-03-02\n" + GOOD_LINES + "\n\n",
        "phase_deg, magnitude, frequency_hz\n78, 0.2, 0.1\n26.5, 0.89, 1\n3, 1.0, 10\n",
    ],
    ids=["plain", "from a spreadsheet", "with remarks", "other order"],
)
def test_a_calibration_sheet_is_read_as_it_was_written(tmp_path: Path, text: str) -> None:
    assert read_calibration_sheet(sheet(tmp_path, text)) == ResponseTable(
        (0.1, 1.0, 10.0), (0.2, 0.89, 1.0), (78.0, 26.5, 3.0)
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r":1: columns must be frequency_hz, magnitude, phase_deg, got "),
        ("frequency_hz,gain\n1,1\n", r":1: columns must be .*, got frequency_hz, gain"),
        (GOOD_LINES.replace(",", ";"), r":1: columns must be .*frequency_hz;magnitude"),
        (HEADER + "0,1,0\n1,1,0\n", r":2: frequency_hz must be above 0, got 0"),
        (HEADER + "-1,1,0\n1,1,0\n", r":2: frequency_hz must be above 0, got -1"),
        (HEADER + "1,1,0\n3,1,0\n2,1,0\n", r":4: frequency_hz must rise .*, got 2 after 3"),
        (HEADER + "1,1,0\n1,1,0\n", r":3: frequency_hz must rise .*, got 1 after 1"),
        (HEADER + "1,1,0\n2,,0\n3,1,0\n", r":3: magnitude is missing"),
        (HEADER + "1,1,0\n\n3,1,0\n", r":3: needs 3 values, got 0"),
        (HEADER + "1,1,0\n2,1\n", r":3: needs 3 values, got 2"),
        (HEADER + "1,1,0\n2,0,0\n", r":3: magnitude must be above 0, got 0"),
        (HEADER + "1,1,0\n2,-1,0\n", r":3: magnitude must be above 0, got -1"),
        (HEADER + "1,nan,0\n2,1,0\n", r":2: magnitude must be finite, got nan"),
        (HEADER + "1,1,0\ninf,1,0\n", r":3: frequency_hz must be finite, got inf"),
        (HEADER + "1,1,zero\n2,1,0\n", r":2: phase_deg must be a number, got 'zero'"),
        (HEADER + "1,1,0\n", r":2: needs two points or more, got 1"),
    ],
)
def test_a_wrong_sheet_is_refused_with_file_and_line(
    tmp_path: Path, text: str, message: str
) -> None:
    path = sheet(tmp_path, text)
    with pytest.raises(SheetError, match=r"sheet\.csv" + message):
        read_calibration_sheet(path)


def test_what_is_no_text_or_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SheetError, match=r"nowhere\.csv: No such file"):
        read_calibration_sheet(tmp_path / "nowhere.csv")
    with pytest.raises(SheetError, match="Is a directory"):
        read_calibration_sheet(tmp_path)
    path = tmp_path / "sheet.csv"
    path.write_bytes(HEADER.encode() + b"1,1,0\n\xff\xfe\n")
    with pytest.raises(SheetError, match=r"sheet\.csv:3: not UTF-8"):
        read_calibration_sheet(path)
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(SheetError, match="larger than 1000000 bytes"):
        read_calibration_sheet(path)


def test_a_sheet_of_ten_points_a_decade_reads_a_corner_between_them_true(tmp_path: Path) -> None:
    corner, points_hz = HighPass(0.5), np.geomspace(0.05, 50.0, 31)
    lines = [
        f"{f:.6g},{abs(h):.6g},{np.degrees(np.angle(h)):.6g}\n"
        for f, h in zip(points_hz, corner.at(points_hz), strict=True)
    ]
    between_hz = np.geomspace(0.05, 50.0, 400)

    table = read_calibration_sheet(sheet(tmp_path, HEADER + "".join(lines)))

    assert np.abs(table.at(between_hz) / corner.at(between_hz) - 1.0).max() < 5e-4
