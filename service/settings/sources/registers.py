"""Values in Modbus registers: address, type, scale and flags, as cells of the adapter."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.modbus.cells import ByteOrder, Cell, MapError, NumberType
from acquisition.modbus.register_map import FlagCheck, FullScale, MapValue, Meaning, ScaleRegister
from core.spectra.polls import AMPLITUDE_PARTS, VectorPart, VectorRow
from service.settings.base import Identifier, MisfitError, Settings

Function = Literal[1, 2, 3, 4]
Address = Annotated[int, Field(ge=0, le=465_535)]
PK_PER = {"pk": 1.0, "pp": 0.5, "rms": math.sqrt(2.0)}
"""Zero-to-peak amplitude of a sine per amplitude of each detector."""

SIGN_OF = {"lead": 1.0, "lag": -1.0}


class CellSettings(Settings):
    """One register, or several that form one number."""

    address: Address
    """Address as in the manual, counted from the ``base`` of the map; example: 609."""

    function: Function | None = None
    """1 (coils), 2 (discrete inputs), 3 (holding) or 4 (input registers); default: the map's."""

    type: NumberType = NumberType.UINT16
    """"int16", "uint16", "int32", "uint32", "float32", "float64" or "bit"."""

    byte_order: ByteOrder | None = None
    """"ABCD", "CDAB", "BADC" or "DCBA", A the most significant byte; default: the map's."""

    bit: Annotated[int, Field(ge=0, le=15)] | None = None
    """Bit of a register, 0 the least significant; with type "bit" and function 3 or 4; example:
    0."""


class ScaleRegisterSettings(CellSettings):
    """value = raw / divisor * this register; both must be read in one request."""

    divisor: float = 32767.0
    """Divisor of the raw number; not 0."""


class FullScaleSettings(Settings):
    """Linear scale from raw numbers to values; raw numbers at its ends count as clipped."""

    minimum: float | None = None
    """Value at ``raw_minimum``."""

    maximum: float | None = None
    """Value at ``raw_maximum``."""

    minimum_register: CellSettings | None = None
    """Register of that value, instead of ``minimum``."""

    maximum_register: CellSettings | None = None
    """Register of that value, instead of ``maximum``."""

    raw_minimum: float = 0.0
    """Raw number at the lower end."""

    raw_maximum: float = 65535.0
    """Raw number at the upper end."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("minimum", "maximum"):
            if (getattr(self, key) is None) == (getattr(self, f"{key}_register") is None):
                raise MisfitError(f"give either this or {key}_register", key)
        return self


class FlagSettings(CellSettings):
    """Status of the value in a status register."""

    mask: Annotated[int, Field(ge=1, le=0xFFFF)] = 0xFFFF
    """Bits of the register that are evaluated; example: 0x0020."""

    set_means: Meaning | None = None
    """"bad": any of these bits makes the value bad. "ok": it is bad unless all are set."""

    ok_values: Annotated[tuple[int, ...], Field(max_length=64)] = ()
    """Masked numbers that mean a good value, instead of ``set_means``."""

    clipped_values: Annotated[tuple[int, ...], Field(max_length=64)] = ()
    """Masked numbers that mean a clipped value, with ``ok_values``."""


class ValueSettings(CellSettings):
    """A value and its conversion from registers: raw * scale + offset."""

    channel: Identifier
    """Channel or slow channel of the value; example: "ujb_shaft_x"."""

    quantity: VectorPart | Literal["value"] = "value"
    """"value": a sample or slow value in the unit of the channel. Of a vector rack:
    "order1_amplitude", "order1_phase", "vortex_amplitude", "overall" or "gap"."""

    detector: Literal["pk", "pp", "rms"] | None = None
    """Detector of amplitudes: zero-to-peak, peak-to-peak or root mean square."""

    phase: Literal["lag", "lead"] | None = None
    """Whether an increasing phase in degrees means a later ("lag") or earlier ("lead") signal."""

    scale: float = 1.0
    """Factor to the unit of the channel; not 0; example: 25.4 from mil to µm."""

    offset: float = 0.0
    """Offset that is added after the factor."""

    scale_register: ScaleRegisterSettings | None = None
    """Register with the full-scale value of a mantissa."""

    full_scale: FullScaleSettings | None = None
    """Range of the raw numbers and of the values."""

    flag: Annotated[tuple[FlagSettings, ...], Field(max_length=8)] = ()
    """Status registers of the value."""

    invalid_values: Annotated[tuple[float, ...], Field(max_length=16)] = ()
    """Raw numbers that mean an invalid value, as NaN always does; example: [0x8000]."""

    invalid_below: float | None = None
    """Raw number below which values are invalid; example: -32000."""

    invalid_above: float | None = None
    """Raw number above which values are invalid; example: 32000.0."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        has_detector = self.quantity in AMPLITUDE_PARTS
        if (self.detector is not None) != has_detector:
            raise MisfitError(
                'must be "pk", "pp" or "rms" for amplitudes, and only for amplitudes', "detector"
            )
        if (self.phase is not None) != (self.quantity == VectorPart.ORDER1_PHASE):
            raise MisfitError('must be "lag" or "lead" for phases, and only for phases', "phase")
        return self

    @property
    def id(self) -> str:
        """Id of the row of a sample block, or of the slow channel."""
        if isinstance(self.quantity, VectorPart):
            return VectorRow(self.channel, self.quantity).id
        return self.channel

    @property
    def rim_factor(self) -> float:
        """Factor to zero-to-peak amplitude and to degrees of lead."""
        factor = PK_PER[self.detector] if self.detector else 1.0
        return factor * (SIGN_OF[self.phase] if self.phase else 1.0)


@dataclass(frozen=True)
class CellDefaults:
    """Default function code and byte order of a map."""

    function: int
    byte_order: ByteOrder

    def cell(self, cell: CellSettings, *at: int | str) -> Cell:
        """Build a cell. Raises `MapError` if the cell is invalid; the error has the location."""
        try:
            return Cell(
                address=cell.address,
                function=cell.function or self.function,
                type=cell.type,
                byte_order=cell.byte_order or self.byte_order,
                bit=cell.bit,
            )
        except MapError as error:
            raise MapError(str(error), *at, *error.at) from error

    def value(self, number: int, value: ValueSettings) -> MapValue:
        """Build a value, in padwatch's conventions: zero-to-peak, degrees of lead.

        Raises `MapError` if the value is invalid; the error has the location.
        """
        try:
            return MapValue(
                id=value.id,
                cell=self.cell(value),
                scale=value.scale * value.rim_factor,
                offset=value.offset * value.rim_factor,
                scale_register=self._scale_register(value.scale_register),
                full_scale=self._full_scale(value.full_scale),
                flags=tuple(self._flag(flag, n) for n, flag in enumerate(value.flag)),
                invalid_values=value.invalid_values,
                invalid_below=-math.inf if value.invalid_below is None else value.invalid_below,
                invalid_above=math.inf if value.invalid_above is None else value.invalid_above,
            )
        except MapError as error:
            raise MapError(str(error), "value", number, *error.at) from error

    def _scale_register(self, scale: ScaleRegisterSettings | None) -> ScaleRegister | None:
        if scale is None:
            return None
        cell = self.cell(scale, "scale_register")
        try:
            return ScaleRegister(cell=cell, divisor=scale.divisor)
        except MapError as error:
            raise MapError(str(error), "scale_register", *error.at) from error

    def _full_scale(self, span: FullScaleSettings | None) -> FullScale | None:
        if span is None:
            return None
        try:
            return FullScale(
                minimum=self._end(span.minimum, span.minimum_register, "minimum_register"),
                maximum=self._end(span.maximum, span.maximum_register, "maximum_register"),
                raw_minimum=span.raw_minimum,
                raw_maximum=span.raw_maximum,
            )
        except MapError as error:
            raise MapError(str(error), "full_scale", *error.at) from error

    def _end(self, number: float | None, cell: CellSettings | None, key: str) -> float | Cell:
        if number is not None:
            return number
        if cell is None:
            raise MapError("must be given", key)
        return self.cell(cell, key)

    def _flag(self, flag: FlagSettings, number: int) -> FlagCheck:
        try:
            return FlagCheck(
                cell=self.cell(flag),
                mask=flag.mask,
                set_means=flag.set_means,
                ok_values=flag.ok_values,
                clipped_values=flag.clipped_values,
            )
        except MapError as error:
            raise MapError(str(error), "flag", number, *error.at) from error
