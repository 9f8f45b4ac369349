"""A transducer's response from its calibration sheet: CSV with three named columns."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

from acquisition.delivery.small_file import read_small_file
from core.machine.response import ResponseTable

COLUMNS = ("frequency_hz", "magnitude", "phase_deg")
MAX_SHEET_BYTES = 1_000_000


class SheetError(Exception):
    """A calibration sheet that cannot be used; the message has file, line and what is wrong."""


def read_calibration_sheet(path: Path) -> ResponseTable:
    """Read a sheet whose first line names its columns and whose others are points.

    Lines that begin with # and empty lines at the end count for nothing.

    Raises
    ------
    SheetError
        If the file cannot be read, a column or a value is missing, a number is none or not finite,
        frequencies do not rise from above zero, or a magnitude is not above zero.
    """
    rows = _rows(path, _read(path))
    number, header = next(rows, (1, []))
    if sorted(header) != sorted(COLUMNS):
        wanted = ", ".join(COLUMNS)
        raise SheetError(f"{path}:{number}: columns must be {wanted}, got {', '.join(header)}")
    points: list[tuple[float, ...]] = []
    for number, cells in rows:
        values = dict(zip(header, _numbers(path, number, header, cells), strict=True))
        point = tuple(values[name] for name in COLUMNS)
        _check(f"{path}:{number}", point, points)
        points.append(point)
    if len(points) < 2:
        raise SheetError(f"{path}:{number}: needs two points or more, got {len(points)}")
    frequency_hz, magnitude, phase_deg = zip(*points, strict=True)
    return ResponseTable(frequency_hz, magnitude, phase_deg)


def _read(path: Path) -> str:
    try:
        content = read_small_file(path, MAX_SHEET_BYTES)
        return content.decode("utf-8-sig").rstrip()
    except OSError as error:
        raise SheetError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SheetError(f"{path}:{line}: not UTF-8 text at byte {error.start}") from error


def _rows(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and cells."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("#"):
            continue
        try:
            yield number, [cell.strip() for cell in next(csv.reader([line]), [])]
        except csv.Error as error:
            raise SheetError(f"{path}:{number}: {error}") from error


def _numbers(path: Path, number: int, header: list[str], cells: list[str]) -> list[float]:
    if len(cells) != len(header):
        raise SheetError(f"{path}:{number}: needs {len(header)} values, got {len(cells)}")
    return [
        _number(f"{path}:{number}: {name}", cell) for name, cell in zip(header, cells, strict=True)
    ]


def _number(place: str, cell: str) -> float:
    if not cell:
        raise SheetError(f"{place} is missing; leave out the whole point, or measure it")
    try:
        value = float(cell)
    except ValueError as error:
        raise SheetError(f"{place} must be a number, got {cell!r}") from error
    if not math.isfinite(value):
        raise SheetError(f"{place} must be finite, got {cell}")
    return value


def _check(place: str, point: tuple[float, ...], before: list[tuple[float, ...]]) -> None:
    frequency_hz, magnitude, _ = point
    if frequency_hz <= 0.0:
        raise SheetError(f"{place}: frequency_hz must be above 0, got {frequency_hz:g}")
    if before and frequency_hz <= before[-1][0]:
        raise SheetError(
            f"{place}: frequency_hz must rise from line to line,"
            f" got {frequency_hz:g} after {before[-1][0]:g}"
        )
    if magnitude <= 0.0:
        raise SheetError(f"{place}: magnitude must be above 0, got {magnitude:g}")
