"""Register map of a Modbus device: values, time stamps and signature."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.modbus.cells import ByteOrder, Cell
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.device_time import CALENDAR_FIELDS, CalendarTime, EpochTime
from acquisition.modbus.read_plan import MapError
from acquisition.modbus.register_map import RegisterMap, Signature, Together
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
    """Registers that must be read in one request."""

    address: Address
    """First register, as in the manual."""

    count: Annotated[int, Field(ge=1, le=125)]
    """Number of registers, 1 to 125."""

    function: Literal[3, 4] | None = None
    """Default: the map's."""


class EpochTimeSettings(Settings):
    """Seconds since 1970 UTC."""

    kind: Literal["epoch"]
    """Always "epoch"."""

    seconds: CellSettings
    """Register of the seconds; example: { address = 4, type = "uint32", byte_order = "CDAB" }."""

    parts: CellSettings | None = None
    """Register of fractions of a second, if any."""

    parts_per_s: Annotated[float, Field(ge=1.0, le=1e9)] = 1e6
    """Number of fractions per second; example: 1000.0."""

    def plain(self, default: MapDefaults) -> EpochTime:
        """Return the time as a value of the adapters."""
        return EpochTime(
            seconds=default.cell(self.seconds, "time", "seconds"),
            parts=_optional(default, self.parts, "time", "parts"),
            parts_per_s=self.parts_per_s,
        )


class CalendarTimeSettings(Settings):
    """Six registers with date and time."""

    kind: Literal["calendar"]
    """Always "calendar"."""

    first: CellSettings
    """First of the six registers."""

    fields: Annotated[tuple[str, ...], Field(min_length=6, max_length=6)] = CALENDAR_FIELDS
    """Order of the six registers."""

    utc_offset_s: Annotated[float, Field(ge=-86400.0, le=86400.0)] = 0.0
    """Offset of the device's clock from UTC, s; example: -10800."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if sorted(self.fields) != sorted(CALENDAR_FIELDS):
            raise MisfitError(f"must name each of {', '.join(CALENDAR_FIELDS)} once", "fields")
        return self

    def plain(self, default: MapDefaults) -> CalendarTime:
        """Return the time as a value of the adapters."""
        first = default.cell(self.first, "time", "first")
        default.require_in_space(first.address, len(self.fields), "time", "first")
        return CalendarTime(first=first, fields=self.fields, utc_offset_s=self.utc_offset_s)


class SignatureSettings(CellSettings):
    """A register that identifies the device."""

    expected: float
    """Expected value of the register."""


class RegisterMapSettings(Settings):
    """Register map of a device, as in its manual."""

    base: Literal[0, 1, 10001, 30001, 40001, 100001, 300001, 400001] = 0
    """Number of the first register in the manual: 0, 1, or 10001, 30001, 40001, 100001, 300001,
    400001."""

    function: Function = 3
    """Default function code: 3 holding, 4 input registers, 1 coils, 2 inputs."""

    byte_order: ByteOrder = ByteOrder.ABCD
    """Default byte order: "ABCD", "CDAB", "BADC" or "DCBA"."""

    max_registers: Annotated[int, Field(ge=1, le=125)] = 125
    """Maximum number of registers in one read, 1 to 125."""

    max_gap: Annotated[int, Field(ge=0, le=124)] = 0
    """Maximum number of unused registers between two values in one read; they must exist in the
    device, or the read fails."""

    min_poll_period_s: Annotated[float, Field(ge=0.0, le=86400.0)] = 0.0
    """Minimum poll period by the manual, in seconds."""

    min_timeout_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Minimum time-out by the manual, in seconds."""

    heartbeat: CellSettings | None = None
    """Counter that changes with every measurement; if it stops, the device counts as stale."""

    time: (
        Annotated[EpochTimeSettings | CalendarTimeSettings, Field(discriminator="kind")] | None
    ) = None
    """Time of the measurement by the clock of the device."""

    signature: Annotated[tuple[SignatureSettings, ...], Field(max_length=16)] = ()
    """Registers that are checked before values are used."""

    together: Annotated[tuple[TogetherSettings, ...], Field(max_length=200)] = ()
    """Blocks that must be read in one request."""

    value: Annotated[tuple[ValueSettings, ...], Field(min_length=1, max_length=500)]
    """Values to read."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            MapDecoder(self.register_map())
        except MapError as error:
            raise MisfitError(str(error), *error.at) from error
        return self

    def register_map(self) -> RegisterMap:
        """Return the map of the adapters. Raises `MisfitError` if no device can have it."""
        default = MapDefaults(self.base, self.function, self.byte_order)
        register = 4 if self.function == 4 else 3
        for n, block in enumerate(self.together):
            default.require_in_space(block.address, block.count, "together", n)
            if block.count > self.max_registers:
                limit = f"must not be above max_registers, {self.max_registers}"
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
    """Read and check a register map.

    Raises `TomlFileError` if it cannot be read or anything in it is wrong.
    """
    return load_toml(path, RegisterMapSettings)
