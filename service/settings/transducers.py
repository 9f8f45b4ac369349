"""Frequency response of a transducer: a model, or a calibration sheet in CSV."""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from acquisition.delivery.small_file import read_small_file
from core.machine.response import (
    BUTTERWORTH_DAMPING,
    HighPass,
    Resonance,
    Response,
    ResponseChain,
    ResponseTable,
)
from service.settings.base import MisfitError, Settings
from service.settings.toml_file import FOLDER

COLUMNS = ("frequency_hz", "magnitude", "phase_deg")
MAX_SHEET_BYTES = 1_000_000


class SheetError(Exception):
    """A calibration sheet cannot be used; the message has file, line and fault."""


def read_calibration_sheet(path: Path) -> ResponseTable:
    """Read a sheet: a line with the names of the columns, then one line per point.

    Lines that begin with # and empty lines at the end are ignored.

    Raises `SheetError` if the file cannot be read, a column or a value is missing, a value is not a
    finite number, frequencies do not increase from above zero, or a magnitude is not above zero.
    """
    rows = _rows(path, _read(path))
    number, header = next(rows, (1, []))
    if sorted(header) != sorted(COLUMNS):
        wanted = ", ".join(COLUMNS)
        raise SheetError(f"{path}:{number}: columns must be {wanted}, got {', '.join(header)}")
    points: list[tuple[float, ...]] = []
    for number, cells in rows:
        place = f"{path}:{number}"
        if len(cells) != len(header):
            raise SheetError(f"{place}: needs {len(header)} values, got {len(cells)}")
        row = dict(zip(header, cells, strict=True))
        point = tuple(_number(f"{place}: {name}", row[name]) for name in COLUMNS)
        _check(place, point, points)
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
    """Yield line numbers and cells."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("#"):
            continue
        try:
            yield number, [cell.strip() for cell in next(csv.reader([line]), [])]
        except csv.Error as error:
            raise SheetError(f"{path}:{number}: {error}") from error


def _number(place: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError as error:
        fault = f"must be a number, got {cell!r}" if cell else "is missing; complete the point"
        raise SheetError(f"{place} {fault}") from error
    if not math.isfinite(value):
        raise SheetError(f"{place} must be finite, got {cell}")
    return value


def _check(place: str, point: tuple[float, ...], before: list[tuple[float, ...]]) -> None:
    frequency_hz, magnitude, _ = point
    if frequency_hz <= (before[-1][0] if before else 0.0):
        lowest = f"the one before, {before[-1][0]:g}" if before else "0"
        raise SheetError(f"{place}: frequency_hz must be above {lowest}, got {frequency_hz:g}")
    if magnitude <= 0.0:
        raise SheetError(f"{place}: magnitude must be above 0, got {magnitude:g}")


class HighPassSettings(Settings):
    """A lower frequency limit: of an accelerometer, a charge amplifier or a velocity pickup."""

    kind: Literal["high_pass"]
    """Always "high_pass"."""

    corner_hz: Annotated[float, Field(ge=0.001, le=100.0)]
    """The -3 dB frequency of order 1, the natural frequency of order 2, Hz; example: 0.5."""

    order: Literal[1, 2] = 1
    """1 for a single time constant, 2 for a seismic mass or a double time constant."""

    damping: Annotated[float, Field(ge=0.05, le=5.0)] = BUTTERWORTH_DAMPING
    """Share of critical damping, for order 2; default: -3 dB at the natural frequency."""

    def response(self) -> Response:
        """Return the part in core's terms."""
        return HighPass(self.corner_hz, self.order, self.damping)


class ResonanceSettings(Settings):
    """A mounted resonance, or any upper limit of second order."""

    kind: Literal["resonance"]
    """Always "resonance"."""

    natural_hz: Annotated[float, Field(ge=1.0, le=1e6)]
    """Natural frequency, Hz; example: 2500.0."""

    damping: Annotated[float, Field(ge=0.001, le=5.0)]
    """Share of critical damping; example: 0.02."""

    def response(self) -> Response:
        """Return the part in core's terms."""
        return Resonance(self.natural_hz, self.damping)


class SheetSettings(Settings):
    """A response measured by a calibration laboratory."""

    kind: Literal["sheet"]
    """Always "sheet"."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """CSV with columns frequency_hz, magnitude and phase_deg, relative to the folder of the plant
    file. The magnitude is 1 if the nominal sensitivity is exact; the phase is positive if the
    reading leads the motion. Example: "ujb_bearing_x.csv"."""

    _table: ResponseTable = PrivateAttr()

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        folder = (info.context or {}).get(FOLDER, Path())
        try:
            self._table = read_calibration_sheet(folder / self.file)
        except SheetError as error:
            raise MisfitError(f"names a sheet that cannot be used: {error}", "file") from error
        return self

    def response(self) -> Response:
        """Return the part in core's terms."""
        return self._table


ResponseSettings: TypeAlias = Annotated[
    HighPassSettings | ResonanceSettings | SheetSettings, Field(discriminator="kind")
]
"""One part of a response."""


def response_of(parts: Sequence[ResponseSettings]) -> Response | None:
    """Return all parts in core's terms; an empty tuple is a flat response."""
    if not parts:
        return None
    return ResponseChain(tuple(part.response() for part in parts))
