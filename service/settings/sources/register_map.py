"""Settings of the register map of a Modbus device: values, time stamp and signature."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.modbus.cells import ByteOrder, Cell
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.read_plan import MapError
from acquisition.modbus.register_map import (
    CALENDAR_FIELDS,
    CalendarTime,
    EpochTime,
    RegisterMap,
    Signature,
    Together,
)
from service.settings.base import MisfitError, Settings
from service.settings.sources.registers import (
    Address,
    CellSettings,
    Function,
    MapDefaults,
    ValueSettings,
    require_apart,
)
from service.settings.toml_file import load_toml


class TogetherSettings(Settings):
    """Block of registers that must be read in one request."""

    address: Address
    """Address of the first register, as in the manual."""

    count: Annotated[int, Field(ge=1, le=125)]
    """Number of registers, 1 to 125."""

    function: Literal[3, 4] | None = None
    """Modbus function code, 3 (holding) or 4 (input registers); default: that of the map."""


class EpochTimeSettings(Settings):
    """Time stamp of the device in seconds since 1970, UTC."""

    kind: Literal["epoch"]
    """Kind of the time stamp, always "epoch"."""

    seconds: CellSettings
    """Register of the seconds; example: { address = 4, type = "uint32", byte_order = "CDAB" }."""

    parts: CellSettings | None = None
    """Register of the fraction of the second, in units of 1 / parts_per_s; none by default."""

    parts_per_s: Annotated[float, Field(ge=1.0, le=1e9)] = 1e6
    """Resolution of `parts`, in parts per second; example: 1000.0."""

    def plain(self, default: MapDefaults) -> EpochTime:
        """Return the settings as an `EpochTime` of the Modbus adapter, completed by defaults."""
        return EpochTime(
            seconds=default.cell(self.seconds, "time", "seconds"),
            parts=_optional(default, self.parts, "time", "parts"),
            parts_per_s=self.parts_per_s,
        )


class CalendarTimeSettings(Settings):
    """Time stamp of the device as six registers with date and time."""

    kind: Literal["calendar"]
    """Kind of the time stamp, always "calendar"."""

    first: CellSettings
    """First of the six consecutive registers."""

    fields: Annotated[tuple[str, ...], Field(min_length=6, max_length=6)] = CALENDAR_FIELDS
    """Calendar fields of the six registers, in the order of the registers."""

    utc_offset_s: Annotated[float, Field(ge=-86400.0, le=86400.0)] = 0.0
    """Offset of the device's clock from UTC, s; example: -10800."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if sorted(self.fields) != sorted(CALENDAR_FIELDS):
            raise MisfitError(f"must contain each of {', '.join(CALENDAR_FIELDS)} once", "fields")
        return self

    def plain(self, default: MapDefaults) -> CalendarTime:
        """Return the settings as a `CalendarTime` of the Modbus adapter, completed by defaults."""
        first = default.cell(self.first, "time", "first")
        default.require_in_space(first.address, len(self.fields), "time", "first")
        return CalendarTime(first=first, fields=self.fields, utc_offset_s=self.utc_offset_s)


class SignatureSettings(CellSettings):
    """Register with constant content that identifies the device."""

    expected: float
    """Expected content of the register."""


class RegisterMapSettings(Settings):
    """Register map of a device, with addresses as in the manual of the device."""

    base: Literal[0, 1, 10001, 30001, 40001, 100001, 300001, 400001] = 0
    """Address of the first register in the manual: 0, 1, 10001, 30001, 40001, 100001, 300001 or
    400001."""

    function: Function = 3
    """Default function code: 1 (coils), 2 (discrete inputs), 3 (holding registers) or 4 (input
    registers)."""

    byte_order: ByteOrder = ByteOrder.ABCD
    """Default byte order: "ABCD", "CDAB", "BADC" or "DCBA"."""

    max_registers: Annotated[int, Field(ge=1, le=125)] = 125
    """Maximum number of registers in one read request, 1 to 125."""

    max_gap: Annotated[int, Field(ge=0, le=124)] = 0
    """Maximum number of unused registers between two values in one read request. Unused registers
    must exist in the device, otherwise the request fails."""

    min_poll_period_s: Annotated[float, Field(ge=0.0, le=86400.0)] = 0.0
    """Minimum poll period according to the manual, s."""

    min_timeout_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Minimum time-out according to the manual, s."""

    heartbeat: CellSettings | None = None
    """Register of a counter that changes with every measurement; if the counter stops, the device
    counts as stale."""

    time: (
        Annotated[EpochTimeSettings | CalendarTimeSettings, Field(discriminator="kind")] | None
    ) = None
    """Registers with the time stamp of the measurement, by the clock of the device."""

    signature: Annotated[tuple[SignatureSettings, ...], Field(max_length=16)] = ()
    """Registers that identify the device, checked before values are used."""

    together: Annotated[tuple[TogetherSettings, ...], Field(max_length=200)] = ()
    """Blocks of registers that must be read in one request."""

    value: Annotated[tuple[ValueSettings, ...], Field(min_length=1, max_length=500)]
    """Values that are read from the device."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            MapDecoder(self.register_map())
        except MapError as error:
            raise MisfitError(str(error), *error.at) from error
        return self

    def register_map(self) -> RegisterMap:
        """Return the settings as a `RegisterMap`, with the defaults of the map in its cells.

        Raises `MisfitError` if they are invalid.
        """
        default = MapDefaults(self.base, self.function, self.byte_order)
        register = 4 if self.function == 4 else 3
        for n, block in enumerate(self.together):
            default.require_in_space(block.address, block.count, "together", n)
            if block.count > self.max_registers:
                limit = f"must not be above max_registers = {self.max_registers}"
                raise MisfitError(limit, "together", n, "count")
        values = tuple(default.value(value, "value", n) for n, value in enumerate(self.value))
        require_apart(values, self.base)
        return RegisterMap(
            values=values,
            base=self.base,
            together=tuple(
                Together(address=t.address, count=t.count, function=t.function or register)
                for t in self.together
            ),
            heartbeat=_optional(default, self.heartbeat, "heartbeat"),
            time=None if self.time is None else self.time.plain(default),
            signature=tuple(
                Signature(cell=default.cell(s, "signature", n), expected=s.expected)
                for n, s in enumerate(self.signature)
            ),
            max_registers=self.max_registers,
            max_gap=self.max_gap,
        )


def _optional(default: MapDefaults, cell: CellSettings | None, *at: int | str) -> Cell | None:
    return None if cell is None else default.cell(cell, *at)


def load_map_file(path: Path) -> RegisterMapSettings:
    """Read and validate the file of a register map.

    Raises `TomlFileError` if the file is unreadable or invalid; the message lists every mistake.
    """
    return load_toml(path, RegisterMapSettings)
