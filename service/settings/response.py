"""The frequency response of a transducer, in parts that work one after the other."""

from collections.abc import Sequence
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
from service.settings.calibration_sheet import SheetError, read_calibration_sheet

FOLDER = "folder"
"""Key of the validation context: where the plant file lies, and so the sheets it names."""


class HighPassSettings(Settings):
    """A lower frequency limit: of an accelerometer, a charge amplifier or a velocity pickup."""

    kind: Literal["high_pass"]
    """Always "high_pass"."""

    corner_hz: Annotated[float, Field(ge=0.001, le=100.0)]
    """Of order 1 the -3 dB frequency, of order 2 the natural frequency, Hz; example: 0.5."""

    order: Literal[1, 2] = 1
    """1 for a single time constant, 2 for a seismic mass or a double time constant."""

    damping: Annotated[float, Field(ge=0.05, le=5.0)] = BUTTERWORTH_DAMPING
    """Share of critical damping, of order 2 alone; default: -3 dB at the natural frequency."""

    def response(self) -> Response:
        """Describe the part as the numerics see it."""
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
        """Describe the part as the numerics see it."""
        return Resonance(self.natural_hz, self.damping)


class SheetSettings(Settings):
    """A response measured by a calibration laboratory."""

    kind: Literal["sheet"]
    """Always "sheet"."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """CSV with columns frequency_hz, magnitude and phase_deg, seen from the plant file's folder;
    magnitude is 1 where the nominal sensitivity is exact, phase is positive where the reading leads
    the motion; example: "ujb_bearing_x.csv"."""

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
        """Describe the part as the numerics see it."""
        return self._table


ResponseSettings: TypeAlias = Annotated[
    HighPassSettings | ResonanceSettings | SheetSettings, Field(discriminator="kind")
]
"""One part of a response."""


def response_of(parts: Sequence[ResponseSettings]) -> Response | None:
    """Describe all parts together as the numerics see them; none is a flat response."""
    if not parts:
        return None
    return ResponseChain(tuple(part.response() for part in parts))
