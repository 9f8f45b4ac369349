"""Register map of a Modbus device: values, time stamps and signature."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.modbus.cells import ByteOrder, Cell, MapError
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.device_time import CALENDAR_FIELDS, CalendarTime, EpochTime
from acquisition.modbus.register_map import RegisterMap, Signature, Together
from service.settings.base import MisfitError, Settings
from service.settings.sources.registers import (
    Address,
    CellDefaults,
    CellSettings,
    Function,
    ValueSettings,
)
from service.settings.toml_file import load_toml


class TogetherSettings(Settings):
    """Registers that must be read as one block."""

    address: Address
    """The first one, as the manual writes it."""

    count: Annotated[int, Field(ge=1, le=125)]
    """How many, 1 to 125."""

    function: Literal[3, 4] | None = None
    """Default: the map's."""


class EpochTimeSettings(Settings):
    """Seconds since 1970 UTC."""

    kind: Literal["epoch"]
    """Always "epoch"."""

    seconds: CellSettings
    """Where the seconds stand; example: { address = 4, type = "uint32", byte_order = "CDAB" }."""

    parts: CellSettings | None = None
    """Where parts of a second stand, if anywhere."""

    parts_per_s: Annotated[float, Field(ge=1.0, le=1e9)] = 1e6
    """How many of them make a second; example: 1000.0."""

    def plain(self, default: CellDefaults) -> EpochTime:
        """As the adapters take it."""
        return EpochTime(
            seconds=default.cell(self.seconds, "time", "seconds"),
            parts=_optional(default, self.parts, "time", "parts"),
            parts_per_s=self.parts_per_s,
        )


class CalendarTimeSettings(Settings):
    """Six registers with the parts of date and time."""

    kind: Literal["calendar"]
    """Always "calendar"."""

    first: CellSettings
    """The first of the six."""

    fields: Annotated[tuple[str, ...], Field(min_length=6, max_length=6)] = CALENDAR_FIELDS
    """In which order they follow each other."""

    utc_offset_s: Annotated[float, Field(ge=-86400.0, le=86400.0)] = 0.0
    """What the device's clock is ahead of UTC; example: -10800."""

    def plain(self, default: CellDefaults) -> CalendarTime:
        """As the adapters take it."""
        first = default.cell(self.first, "time", "first")
        try:
            return CalendarTime(first=first, fields=self.fields, utc_offset_s=self.utc_offset_s)
        except MapError as error:
            raise MapError(str(error), "time", *error.at) from error


class SignatureSettings(CellSettings):
    """A register that tells this device from others."""

    expected: float
    """What must be found in it."""


class RegisterMapSettings(Settings):
    """What stands where in a device, as its manual says."""

    base: int = 0
    """Number that the manual gives to the first register: 0, 1, or 10001, 30001, 40001, 100001,
    300001, 400001."""

    function: Function = 3
    """Function code of all that name none: 3 holding, 4 input registers, 1 coils, 2 inputs."""

    byte_order: ByteOrder = ByteOrder.ABCD
    """Byte order of all that name none: "ABCD", "CDAB", "BADC" or "DCBA"."""

    max_registers: Annotated[int, Field(ge=1, le=125)] = 125
    """Most registers in one read, 1 to 125."""

    max_gap: Annotated[int, Field(ge=0, le=124)] = 0
    """Registers between two values that may be read along; all of them must exist in the device, or
    the whole read fails."""

    min_poll_period_s: Annotated[float, Field(ge=0.0, le=86400.0)] = 0.0
    """Shortest poll period that the manual allows, in seconds."""

    min_timeout_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Shortest time-out that the manual allows, in seconds."""

    heartbeat: CellSettings | None = None
    """A counter that changes with every measurement: one that stands still is a dead device."""

    time: (
        Annotated[EpochTimeSettings | CalendarTimeSettings, Field(discriminator="kind")] | None
    ) = None
    """When the device measured, by its own clock."""

    signature: Annotated[tuple[SignatureSettings, ...], Field(max_length=16)] = ()
    """What must be found before anything is believed."""

    together: Annotated[tuple[TogetherSettings, ...], Field(max_length=200)] = ()
    """Blocks that must be read in one request."""

    value: Annotated[tuple[ValueSettings, ...], Field(min_length=1, max_length=500)]
    """What is read."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            MapDecoder(self.register_map())
        except MapError as error:
            raise MisfitError(str(error), *error.at) from error
        return self

    def register_map(self) -> RegisterMap:
        """The map as the adapters take it. Raises `MapError` if it cannot be used; says where."""
        default = CellDefaults(self.function, self.byte_order)
        register = 4 if self.function == 4 else 3
        return RegisterMap(
            values=tuple(default.value(n, value) for n, value in enumerate(self.value)),
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
            min_poll_period_s=self.min_poll_period_s,
            min_timeout_s=self.min_timeout_s,
        )


def _optional(default: CellDefaults, cell: CellSettings | None, *at: int | str) -> Cell | None:
    return None if cell is None else default.cell(cell, *at)


def load_map_file(path: Path) -> RegisterMapSettings:
    """Read and check a register map.

    Raises `TomlFileError` if it cannot be read or anything in it is wrong.
    """
    return load_toml(path, RegisterMapSettings)
