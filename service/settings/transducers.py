"""Settings of the frequency response of a transducer: analytic elements or a CSV calibration."""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from core.machine.response import (
    BUTTERWORTH_DAMPING,
    HighPass,
    Resonance,
    Response,
    ResponseChain,
    ResponseTable,
)
from service.settings.base import MisfitError, Settings
from service.settings.toml_file import FOLDER, read_text

COLUMNS = ("frequency_hz", "magnitude", "phase_deg")
MAX_SHEET_BYTES = 1_000_000


class SheetError(Exception):
    """Error raised if a calibration sheet is invalid; the message states file, line and fault."""


def read_calibration_sheet(path: Path) -> ResponseTable:
    """Read a CSV calibration sheet: a header line with the column names, then one line per point.

    The columns `COLUMNS` may be in any order. Lines that begin with # and empty lines at the end
    are ignored.

    Raises `SheetError` if the file is unreadable, a column or value is missing, a value is not a
    finite number, a frequency or magnitude is not above zero, or frequencies do not increase.
    """
    text = read_text(path, MAX_SHEET_BYTES, SheetError, "utf-8-sig")
    rows = _rows(path, text.rstrip())
    number, header = next(rows, (1, []))
    if sorted(header) != sorted(COLUMNS):
        wanted = ", ".join(COLUMNS)
        raise SheetError(f"{path}:{number}: columns must be {wanted}, got {', '.join(header)}")
    points: list[tuple[float, ...]] = []
    for number, cells in rows:
        place = f"{path}:{number}"
        if len(cells) != len(header):
            raise SheetError(f"{place}: expected {len(header)} values, got {len(cells)}")
        row = dict(zip(header, cells, strict=True))
        point = tuple(_number(f"{place}: {name}", row[name]) for name in COLUMNS)
        before = points[-1][0] if points else 0.0
        if point[0] <= before:
            lowest = f"the previous one, {before:g}" if points else "0"
            raise SheetError(f"{place}: frequency_hz must be above {lowest}, got {point[0]:g}")
        if point[1] <= 0.0:
            raise SheetError(f"{place}: magnitude must be above 0, got {point[1]:g}")
        points.append(point)
    if len(points) < 2:
        raise SheetError(f"{path}:{number}: expected at least two points, got {len(points)}")
    frequency_hz, magnitude, phase_deg = zip(*points, strict=True)
    return ResponseTable(frequency_hz, magnitude, phase_deg)


def _rows(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the CSV fields of each line that is not a comment."""
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
        fault = f"must be a number, got {cell!r}" if cell else "is missing"
        raise SheetError(f"{place} {fault}") from error
    if not math.isfinite(value):
        raise SheetError(f"{place} must be finite, got {cell}")
    return value


class HighPassSettings(Settings):
    """High-pass response of an accelerometer, charge amplifier or velocity pickup."""

    kind: Literal["high_pass"]
    """Kind of the element, always "high_pass"."""

    corner_hz: Annotated[float, Field(ge=0.001, le=100.0)]
    """Corner frequency, Hz: -3 dB frequency for order 1, natural frequency for order 2; example:
    0.5."""

    order: Literal[1, 2] = 1
    """Order of the high-pass: 1 for a single time constant, 2 for a seismic mass or a double time
    constant."""

    damping: Annotated[float, Field(ge=0.05, le=5.0)] = BUTTERWORTH_DAMPING
    """Damping ratio for order 2; default: -3 dB at the natural frequency."""

    def response(self) -> Response:
        """Return the settings as a `HighPass` response."""
        return HighPass(self.corner_hz, self.order, self.damping)


class ResonanceSettings(Settings):
    """Mounted resonance of a transducer, or another second-order low-pass response."""

    kind: Literal["resonance"]
    """Kind of the element, always "resonance"."""

    natural_hz: Annotated[float, Field(ge=1.0, le=1e6)]
    """Natural frequency of the resonance, Hz; example: 2500.0."""

    damping: Annotated[float, Field(ge=0.001, le=5.0)]
    """Damping ratio of the resonance; example: 0.02."""

    def response(self) -> Response:
        """Return the settings as a `Resonance` response."""
        return Resonance(self.natural_hz, self.damping)


class SheetSettings(Settings):
    """Frequency response measured by a calibration laboratory."""

    kind: Literal["sheet"]
    """Kind of the element, always "sheet"."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """CSV file with columns frequency_hz, magnitude and phase_deg; the path is relative to the
    folder of the plant file. The magnitude is 1 where the nominal sensitivity is exact; the phase
    is positive where the reading leads the motion. Example: "ujb_bearing_x.csv"."""

    _table: ResponseTable = PrivateAttr()

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        folder = (info.context or {}).get(FOLDER, Path())
        try:
            self._table = read_calibration_sheet(folder / self.file)
        except SheetError as error:
            raise MisfitError(f"calibration sheet cannot be used: {error}", "file") from error
        return self

    def response(self) -> Response:
        """Return the response that was read from the calibration sheet."""
        return self._table


ResponseSettings: TypeAlias = Annotated[
    HighPassSettings | ResonanceSettings | SheetSettings, Field(discriminator="kind")
]
"""Settings of one element of a frequency response, of any kind."""


def response_of(parts: Sequence[ResponseSettings]) -> Response | None:
    """Return the product of the responses of all elements; None (flat) without elements."""
    if not parts:
        return None
    return ResponseChain(tuple(part.response() for part in parts))
