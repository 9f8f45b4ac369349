"""`RegisterMap`: the values of one device and their registers, as described in its manual.

The settings of a register map are validated when they are loaded, and not checked here again.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

from acquisition.modbus.cells import Cell
from acquisition.modbus.requests import MAX_REGISTERS_PER_READ
from core.units import ns_from_s


class Meaning(StrEnum):
    """Meaning of a set bit of a status register."""

    BAD = "bad"
    OK = "ok"


@dataclass(frozen=True, kw_only=True)
class FlagCheck:
    """Rule that derives the state of a value from a status register, by bits or by a number.

    Parameters
    ----------
    mask
        Bits that are evaluated; 1 for a cell of a single bit. The status number is the masked
        content divided by `lowest_bit`.
    set_means
        "bad": the value is bad if any masked bit is set. "ok": the value is bad unless all masked
        bits are set. None: the status number decides.
    ok_values
        Status numbers of a good value, instead of `set_means`; all other numbers are bad.
    clipped_values
        Status numbers of a clipped value.
    """

    cell: Cell
    mask: int = 0xFFFF
    set_means: Meaning | None = None
    ok_values: tuple[int, ...] = ()
    clipped_values: tuple[int, ...] = ()

    @property
    def lowest_bit(self) -> int:
        """Lowest bit of the mask, as a power of 2."""
        return self.mask & -self.mask


@dataclass(frozen=True, kw_only=True)
class ScaleRegister:
    """Register with the full scale of a value: number = raw number / divisor * register."""

    cell: Cell
    divisor: float = 32767.0


@dataclass(frozen=True, kw_only=True)
class FullScale:
    """Linear mapping of raw numbers to a range; a raw number at either end is clipped.

    Parameters
    ----------
    minimum
        Value at `raw_minimum`: a number, or the cell that contains the number.
    maximum
        Value at `raw_maximum`: a number, or the cell that contains the number.
    """

    minimum: float | Cell
    maximum: float | Cell
    raw_minimum: float = 0.0
    raw_maximum: float = 65535.0


@dataclass(frozen=True, kw_only=True)
class MapValue:
    """One value of a device: value = number * scale + offset.

    The number is the raw number, or the result of the scale register or full scale if given.

    Parameters
    ----------
    flags
        Checks of status bits; the worst state of all checks applies to the value.
    invalid_values
        Raw numbers that mark an invalid value; integers are compared by their bits: 0x8000 equals
        -32768. NaN is always invalid.
    invalid_below
        Lowest valid raw number.
    invalid_above
        Highest valid raw number.
    """

    id: str
    cell: Cell
    scale: float = 1.0
    offset: float = 0.0
    scale_register: ScaleRegister | None = None
    full_scale: FullScale | None = None
    flags: tuple[FlagCheck, ...] = ()
    invalid_values: tuple[float, ...] = ()
    invalid_below: float = -math.inf
    invalid_above: float = math.inf

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that the value needs, first the cell of the value itself."""
        yield self.cell
        if self.scale_register is not None:
            yield self.scale_register.cell
        if self.full_scale is not None:
            ends = (self.full_scale.minimum, self.full_scale.maximum)
            yield from (end for end in ends if isinstance(end, Cell))
        yield from (flag.cell for flag in self.flags)


CALENDAR_FIELDS = ("year", "month", "day", "hour", "minute", "second")
_CENTURY = 2000

_LATEST_S = 2.0**33
"""Latest valid device time (year 2242), s since 1970; int64 nanoseconds since 1970 end in 2262."""


@dataclass(frozen=True, kw_only=True)
class EpochTime:
    """Device time as seconds since 1970, with an optional cell for the fraction of a second.

    Parameters
    ----------
    parts
        Cell of the fraction; None if the device has whole seconds only.
    parts_per_s
        Units of the fraction per second; example: 1e6 for microseconds.
    """

    seconds: Cell
    parts: Cell | None = None
    parts_per_s: float = 1e6

    @property
    def resolution_s(self) -> float:
        """Resolution of the device time, s."""
        return 1.0 if self.parts is None else 1.0 / self.parts_per_s

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that hold the time."""
        yield self.seconds
        if self.parts is not None:
            yield self.parts

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """Return UTC in ns since 1970 from the numbers of `cells`; None for an invalid time."""
        if not all(map(math.isfinite, numbers)) or numbers[0] <= 0.0:
            return None
        parts = numbers[1] / self.parts_per_s if self.parts is not None else 0.0
        if not 0.0 < numbers[0] + parts < _LATEST_S or abs(parts) > _LATEST_S:
            return None
        return ns_from_s(numbers[0]) + ns_from_s(parts)


@dataclass(frozen=True, kw_only=True)
class CalendarTime:
    """Device time as date and time of day in six consecutive registers.

    Parameters
    ----------
    first
        Cell of the first of the six registers.
    fields
        "year", "month", "day", "hour", "minute" and "second" in the order of the registers. A
        year below 100 belongs to the current century (2000 to 2099).
    utc_offset_s
        Device clock minus UTC, s.
    """

    first: Cell
    fields: tuple[str, ...] = CALENDAR_FIELDS
    utc_offset_s: float = 0.0

    @property
    def resolution_s(self) -> float:
        """Resolution of the device time, s."""
        return 1.0

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that hold the time."""
        for n in range(len(self.fields)):
            yield Cell(
                address=self.first.address + n,
                function=self.first.function,
                byte_order=self.first.byte_order,
            )

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """Return UTC in ns since 1970 from the numbers of `cells`; None for an invalid time."""
        part = dict(zip(self.fields, map(int, numbers), strict=True))
        part["year"] += _CENTURY if part["year"] < 100 else 0
        try:
            moment = datetime(**part, tzinfo=UTC)
        except ValueError:
            return None
        if moment.timestamp() > _LATEST_S:
            return None
        return ns_from_s(moment.timestamp()) - ns_from_s(self.utc_offset_s)


@dataclass(frozen=True, kw_only=True)
class Together:
    """Block of registers that must be read in one request, as the manual requires.

    `address` is the address of the first register, as printed in the manual.
    """

    address: int
    count: int
    function: int = 3


@dataclass(frozen=True, kw_only=True)
class Signature:
    """Cell with a known number that identifies the device; read on connecting."""

    cell: Cell
    expected: float


@dataclass(frozen=True, kw_only=True)
class RegisterMap:
    """Values of a device, and the rules for reading their registers.

    Parameters
    ----------
    base
        Number that the manual gives to the first register of the device; examples: 0, 1, 40001.
    together
        Blocks of registers that must be read in one request.
    heartbeat
        Cell that changes with each measurement of the device; None if the device has none.
    time
        Cells with the time of the measurement by the device's clock; None if the device has none.
    signature
        Cells with known numbers; they are checked on connecting, before any value is used.
    max_registers
        Maximum number of registers in one read, 1 to 125.
    max_gap
        Two cells are read in one request if at most this number of unconfigured registers lies
        between them. If one of these registers does not exist, the whole read fails.
    """

    values: tuple[MapValue, ...]
    base: int = 0
    together: tuple[Together, ...] = ()
    heartbeat: Cell | None = None
    time: EpochTime | CalendarTime | None = None
    signature: tuple[Signature, ...] = ()
    max_registers: int = MAX_REGISTERS_PER_READ
    max_gap: int = 0

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the values, in the order of the map."""
        return tuple(value.id for value in self.values)

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that are read in every poll."""
        for value in self.values:
            yield from value.cells()
        if self.heartbeat is not None:
            yield self.heartbeat
        if self.time is not None:
            yield from self.time.cells()
