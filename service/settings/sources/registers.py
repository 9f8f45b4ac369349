"""Settings of values in Modbus registers, and their conversion for the Modbus adapter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from acquisition.modbus.cells import FLOATS, INTEGERS, N_BYTES, ByteOrder, Cell, NumberType
from acquisition.modbus.register_map import FlagCheck, FullScale, MapValue, Meaning, ScaleRegister
from acquisition.modbus.requests import ADDRESS_SPACE, REGISTER_FUNCTIONS
from core.spectra.polls import AMPLITUDE_PARTS, VectorPart, VectorRow
from service.settings.base import Identifier, MisfitError, MissingError, Settings

Function = Literal[1, 2, 3, 4]
Address = Annotated[int, Field(ge=0, le=465_535)]
ALL_BITS = 0xFFFF
PK_PER = {"pk": 1.0, "pp": 0.5, "rms": math.sqrt(2.0)}
"""Factor from the reading of each detector to the zero-to-peak amplitude of a sine."""

SIGN_OF = {"lead": 1.0, "lag": -1.0}


def _refuse_zero(number: float) -> float:
    if number == 0.0:
        raise MisfitError("must not be 0")
    return number


NotZero = Annotated[float, AfterValidator(_refuse_zero)]


class CellSettings(Settings):
    """Register, or consecutive registers that form one number."""

    address: Address
    """Address of the first register as in the manual, counted from the ``base`` of the map;
    example: 609."""

    function: Function | None = None
    """Modbus function code: 1 (coils), 2 (discrete inputs), 3 (holding registers) or 4 (input
    registers); default: that of the map."""

    type: NumberType = NumberType.UINT16
    """Data type: "int16", "uint16", "int32", "uint32", "float32", "float64" or "bit"."""

    byte_order: ByteOrder | None = None
    """Byte order: "ABCD", "CDAB", "BADC" or "DCBA", where A is the most significant byte; default:
    that of the map."""

    bit: Annotated[int, Field(ge=0, le=15)] | None = None
    """Number of the bit in a register, 0 for the least significant bit; only with type "bit" and
    function 3 or 4; example: 0."""


class ScaleRegisterSettings(CellSettings):
    """Register with the full-scale value of a mantissa: value = raw / divisor * content.

    The mantissa and this register must be read in one request.
    """

    divisor: NotZero = 32767.0
    """Divisor of the raw number; not 0."""


class FullScaleSettings(Settings):
    """Linear scale from raw numbers to values; a raw number at either end counts as clipped."""

    minimum: float | None = None
    """Value at ``raw_minimum``."""

    maximum: float | None = None
    """Value at ``raw_maximum``."""

    minimum_register: CellSettings | None = None
    """Register with the value at ``raw_minimum``, instead of ``minimum``."""

    maximum_register: CellSettings | None = None
    """Register with the value at ``raw_maximum``, instead of ``maximum``."""

    raw_minimum: float = 0.0
    """Raw number at the lower end of the scale."""

    raw_maximum: float = 65535.0
    """Raw number at the upper end of the scale."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("minimum", "maximum"):
            if (getattr(self, key) is None) == (getattr(self, f"{key}_register") is None):
                raise MisfitError(f"exactly one of {key} and {key}_register must be given", key)
        if not self.raw_minimum < self.raw_maximum:
            raise MisfitError(f"must be below raw_maximum = {self.raw_maximum:g}", "raw_minimum")
        return self


class FlagSettings(CellSettings):
    """Status register, or selected bits, that state whether a value is good, bad or clipped."""

    mask: Annotated[int, Field(ge=1, le=ALL_BITS)] = ALL_BITS
    """Bit mask of the evaluated bits of the register; example: 0x0020."""

    set_means: Meaning | None = None
    """Meaning of set bits: with "bad" the value is bad if any of the bits is set, with "ok" the
    value is bad unless all of the bits are set."""

    ok_values: Annotated[tuple[int, ...], Field(max_length=64)] = ()
    """Masked register contents of a good value, instead of ``set_means``."""

    clipped_values: Annotated[tuple[int, ...], Field(max_length=64)] = ()
    """Masked register contents of a clipped value; only with ``ok_values``."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.type in FLOATS:
            raise MisfitError('must be an integer type such as "uint16" for flags', "type")
        if self.type is NumberType.BIT and self.mask not in (1, ALL_BITS):
            raise MisfitError('does not apply to type "bit"; remove it', "mask")
        if (self.set_means is None) == (not self.ok_values):
            words = "exactly one of set_means and ok_values must be given"
            raise MisfitError(words, "set_means")
        if self.clipped_values and not self.ok_values:
            raise MisfitError("requires ok_values, the contents of a good value", "clipped_values")
        highest = self.counted_bits // (self.counted_bits & -self.counted_bits)
        for name in ("ok_values", "clipped_values"):
            for number in getattr(self, name):
                if not 0 <= number <= highest:
                    words = f"must be within the mask, 0 to {highest}, got {number}"
                    raise MisfitError(words, name)
        return self

    @property
    def counted_bits(self) -> int:
        """Bit mask of the evaluated bits; 1 for type "bit"."""
        return 1 if self.type is NumberType.BIT else self.mask


class ValueSettings(CellSettings):
    """Value of a channel and its conversion from registers: raw * scale + offset."""

    channel: Identifier
    """Id of the channel or slow channel of the value; example: "ujb_shaft_x"."""

    quantity: VectorPart | Literal["value"] = "value"
    """Quantity of the value: "value" is a sample or slow value in the unit of the channel.
    Quantities of a vector rack are "order1_amplitude", "order1_phase", "vortex_amplitude",
    "overall" and "gap"."""

    detector: Literal["pk", "pp", "rms"] | None = None
    """Detector of an amplitude: "pk" zero-to-peak, "pp" peak-to-peak or "rms" root mean square."""

    phase: Literal["lag", "lead"] | None = None
    """Sign convention of a phase in degrees: phase "lag" or phase "lead"."""

    scale: NotZero = 1.0
    """Factor from the raw number to the unit of the channel; not 0; example: 25.4 from mil to
    µm."""

    offset: float = 0.0
    """Offset that is added after multiplication by ``scale``."""

    scale_register: ScaleRegisterSettings | None = None
    """Register with the full-scale value; the raw number is a mantissa."""

    full_scale: FullScaleSettings | None = None
    """Linear scale from a range of raw numbers to a range of values."""

    flag: Annotated[tuple[FlagSettings, ...], Field(max_length=8)] = ()
    """Status registers that state whether the value is good, bad or clipped."""

    invalid_values: Annotated[tuple[float, ...], Field(max_length=16)] = ()
    """Raw numbers of invalid values; NaN is always invalid. Example: [0x8000]."""

    invalid_below: float | None = None
    """Raw number below which a value is invalid; example: -32000."""

    invalid_above: float | None = None
    """Raw number above which a value is invalid; example: 32000.0."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key, parts in (("detector", AMPLITUDE_PARTS), ("phase", {VectorPart.ORDER1_PHASE})):
            is_given, is_needed = getattr(self, key) is not None, self.quantity in parts
            if is_needed and not is_given:
                raise MissingError(f"is missing; quantity {self.quantity} requires it", key)
            if is_given and not is_needed:
                raise MisfitError(f"applies only to quantity {' or '.join(parts)}; remove it", key)
        if self.scale_register is not None and self.full_scale is not None:
            words = "cannot be combined with full_scale; remove one of them"
            raise MisfitError(words, "scale_register")
        low, high = self.invalid_below, self.invalid_above
        if low is not None and high is not None and not low < high:
            raise MisfitError(f"must be below invalid_above = {high:g}", "invalid_below")
        n_bits = 8 * N_BYTES[self.type]
        for number in self.invalid_values if self.type in INTEGERS else ():
            if number % 1 or not -(1 << n_bits - 1) <= number < 1 << n_bits:
                words = f"must be integers of {n_bits} bits, got {number:.12g}"
                raise MisfitError(words, "invalid_values")
        return self

    @property
    def id(self) -> str:
        """Id of the row of a sample block, or of the slow channel, that contains the value."""
        if isinstance(self.quantity, VectorPart):
            return VectorRow(self.channel, self.quantity).id
        return self.channel

    @property
    def rim_factor(self) -> float:
        """Factor from the reading to zero-to-peak amplitude or phase lead; 1 for other values."""
        factor = PK_PER[self.detector] if self.detector else 1.0
        return factor * (SIGN_OF[self.phase] if self.phase else 1.0)


@dataclass(frozen=True)
class MapDefaults:
    """Defaults of a register map: first address, function code and byte order of its cells.

    All methods raise `MisfitError` with the location in the map.
    """

    base: int
    function: int
    byte_order: ByteOrder

    def require_in_space(self, address: int, count: int, *at: int | str) -> None:
        """Raise `MisfitError` if ``count`` registers from ``address`` exceed the address space."""
        last = self.base + ADDRESS_SPACE - count
        if not self.base <= address <= last:
            words = f"must be {self.base} to {last}, since addresses begin at {self.base}"
            raise MisfitError(words, *at, "address")

    def cell(self, settings: CellSettings, *at: int | str) -> Cell:
        """Return the settings, completed by the defaults, as a `Cell` of the Modbus adapter.

        `at` is the location of the settings in the register map, for the error.
        """
        cell = Cell(
            address=settings.address,
            function=settings.function or self.function,
            type=settings.type,
            byte_order=settings.byte_order or self.byte_order,
            bit=settings.bit,
        )
        is_bit, in_register = cell.type is NumberType.BIT, cell.function in REGISTER_FUNCTIONS
        if not in_register and not is_bit:
            words = 'must be "bit" for functions 1 and 2, which read single bits'
            raise MisfitError(words, *at, "type")
        if cell.bit is None and is_bit and in_register:
            words = 'is missing; type "bit" with function 3 or 4 requires it'
            raise MissingError(words, *at, "bit")
        if cell.bit is not None and not (is_bit and in_register):
            words = 'applies only to type "bit" with function 3 or 4; remove it'
            raise MisfitError(words, *at, "bit")
        self.require_in_space(cell.address, cell.n_places, *at)
        return cell

    def value(self, settings: ValueSettings, *at: int | str) -> MapValue:
        """Return the settings of a value as a `MapValue`, scaled to zero-to-peak and phase lead."""
        low, high = settings.invalid_below, settings.invalid_above
        scale = settings.scale_register
        return MapValue(
            id=settings.id,
            cell=self.cell(settings, *at),
            scale=settings.scale * settings.rim_factor,
            offset=settings.offset * settings.rim_factor,
            scale_register=None
            if scale is None
            else ScaleRegister(cell=self.cell(scale, *at, "scale_register"), divisor=scale.divisor),
            full_scale=self._full_scale(settings.full_scale, *at, "full_scale"),
            flags=tuple(self._flag(f, *at, "flag", n) for n, f in enumerate(settings.flag)),
            invalid_values=settings.invalid_values,
            invalid_below=-math.inf if low is None else low,
            invalid_above=math.inf if high is None else high,
        )

    def _full_scale(self, span: FullScaleSettings | None, *at: int | str) -> FullScale | None:
        if span is None:
            return None
        ends = {}
        for key in ("minimum", "maximum"):
            cell = getattr(span, f"{key}_register")
            number = getattr(span, key)
            ends[key] = number if cell is None else self.cell(cell, *at, f"{key}_register")
        if ends["minimum"] == ends["maximum"]:
            raise MisfitError("must differ from maximum", *at, "minimum")
        return FullScale(**ends, raw_minimum=span.raw_minimum, raw_maximum=span.raw_maximum)

    def _flag(self, flag: FlagSettings, *at: int | str) -> FlagCheck:
        return FlagCheck(
            cell=self.cell(flag, *at),
            mask=flag.counted_bits,
            set_means=flag.set_means,
            ok_values=flag.ok_values,
            clipped_values=flag.clipped_values,
        )


def require_apart(values: Sequence[MapValue], base: int) -> None:
    """Check that no two values have the same id, or the same register except for different bits.

    Raises `MisfitError` otherwise; the error of a shared register is located at the second value.
    """
    taken: dict[tuple[int, int], MapValue] = {}
    for n, value in enumerate(values):
        cell = value.cell
        for place in range(cell.start(base), cell.stop(base)):
            other = taken.setdefault((cell.function, place), value)
            are_bits = NumberType.BIT is cell.type is other.cell.type
            if other is not value and not (are_bits and None is not cell.bit != other.cell.bit):
                raise MisfitError(
                    f"overlaps the registers of value {other.id!r} (address {other.cell.address},"
                    f" {other.cell.type}); correct one of the addresses",
                    *("value", n, "address"),
                )
        if value.id in [other.id for other in values[:n]]:
            raise MisfitError(
                f"contains the id {value.id!r} twice; each value needs its own", "value"
            )
