"""`RegisterMap`: the values of one device, as its manual describes them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from acquisition.modbus.cells import (
    BASES,
    FLOATS,
    INTEGERS,
    N_BYTES,
    Cell,
    MapError,
    NumberType,
)
from acquisition.modbus.device_time import DeviceTime
from acquisition.modbus.requests import (
    ADDRESS_SPACE,
    MAX_REGISTERS_PER_READ,
    REGISTER_FUNCTIONS,
)

MAX_MASK = 0xFFFF


class Meaning(StrEnum):
    """Meaning of a set bit of a status register."""

    BAD = "bad"
    OK = "ok"


@dataclass(frozen=True, kw_only=True)
class FlagCheck:
    """State of a value by a status register: by its bits, or by its numbers.

    Parameters
    ----------
    mask
        Bits that count; numbers are shifted to its lowest bit before they are compared. Always 1
        for a cell that is a single bit.
    set_means
        "bad": the value is bad if any of these bits is set. "ok": it is bad unless all are.
    ok_values
        Numbers of a good value, instead of `set_means`; all others are bad.
    clipped_values
        Numbers of a clipped value.
    """

    cell: Cell
    mask: int = MAX_MASK
    set_means: Meaning | None = None
    ok_values: tuple[int, ...] = ()
    clipped_values: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.mask <= MAX_MASK:
            raise MapError(f"must be 0x0001 to 0xFFFF, got {self.mask:#06x}", "mask")
        if self.cell.type in FLOATS:
            raise MapError('must be "uint16" or other whole numbers: a float has no flags', "type")
        if self.cell.type is NumberType.BIT:
            if self.mask not in (1, MAX_MASK):
                raise MapError("must be left out: this is one bit already", "mask")
            object.__setattr__(self, "mask", 1)
        if (self.set_means is None) == (not self.ok_values):
            raise MapError("must be given unless ok_values are, and not with them", "set_means")
        if self.clipped_values and not self.ok_values:
            raise MapError("can only be given with ok_values", "clipped_values")
        highest = self.mask // self.lowest_bit
        for name in ("ok_values", "clipped_values"):
            for number in getattr(self, name):
                if not 0 <= number <= highest:
                    words = f"must be numbers of the mask, 0 to {highest}, got {number}"
                    raise MapError(words, name)

    @property
    def lowest_bit(self) -> int:
        """The lowest bit that counts, alone."""
        return self.mask & -self.mask


@dataclass(frozen=True, kw_only=True)
class ScaleRegister:
    """Register with the value of a full mantissa: value = raw / divisor * register."""

    cell: Cell
    divisor: float = 32767.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.divisor) and self.divisor != 0.0):
            raise MapError(f"must not be 0, got {self.divisor:g}", "divisor")


@dataclass(frozen=True, kw_only=True)
class FullScale:
    """A range that is mapped linearly onto the raw numbers; a raw number at its end is clipped.

    Parameters
    ----------
    minimum, maximum
        Values at the ends: numbers, or the cells of the device that hold them.
    """

    minimum: float | Cell
    maximum: float | Cell
    raw_minimum: float = 0.0
    raw_maximum: float = 65535.0

    def __post_init__(self) -> None:
        if not self.raw_minimum < self.raw_maximum:
            raise MapError(f"must be below raw_maximum {self.raw_maximum:g}", "raw_minimum")
        if self.minimum == self.maximum:
            raise MapError("must differ from maximum", "minimum")


@dataclass(frozen=True, kw_only=True)
class MapValue:
    """One value of a device: raw * scale + offset, with a scale register or a range before that.

    Parameters
    ----------
    invalid_values
        Raw numbers of no value; integers are compared by their bits, so that 0x8000 is -32768.
        Not-a-number is always one.
    invalid_below, invalid_above
        Raw numbers beyond these are errors.
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

    def __post_init__(self) -> None:
        if not (math.isfinite(self.scale) and self.scale != 0.0):
            raise MapError(f"must not be 0, got {self.scale:g}", "scale")
        if self.scale_register is not None and self.full_scale is not None:
            raise MapError("cannot be had together with full_scale", "scale_register")
        if not self.invalid_below < self.invalid_above:
            raise MapError(f"must be below invalid_above {self.invalid_above:g}", "invalid_below")
        if self.cell.type in INTEGERS:
            n_bits = 8 * N_BYTES[self.cell.type]
            for number in self.invalid_values:
                if number % 1 or not -(1 << n_bits - 1) <= number < 1 << n_bits:
                    raise MapError(
                        f"must each be a whole number of {n_bits} bits, got {number:.12g}",
                        "invalid_values",
                    )

    def cells(self) -> Iterator[Cell]:
        """Cells that are read for it, its own number first."""
        yield self.cell
        if self.scale_register is not None:
            yield self.scale_register.cell
        if self.full_scale is not None:
            ends = (self.full_scale.minimum, self.full_scale.maximum)
            yield from (end for end in ends if isinstance(end, Cell))
        yield from (flag.cell for flag in self.flags)


@dataclass(frozen=True, kw_only=True)
class Together:
    """Registers that must be read as one block, as the manual demands."""

    address: int
    count: int
    function: int = 3

    def __post_init__(self) -> None:
        if self.function not in REGISTER_FUNCTIONS:
            raise MapError(f"must be 3 or 4, got {self.function}", "function")
        if not 1 <= self.count <= MAX_REGISTERS_PER_READ:
            raise MapError(
                f"must be 1 to {MAX_REGISTERS_PER_READ}, which is all that one read can have,"
                f" got {self.count}",
                "count",
            )


@dataclass(frozen=True, kw_only=True)
class Signature:
    """Number by which the device is identified; read on connecting."""

    cell: Cell
    expected: float


@dataclass(frozen=True, kw_only=True)
class RegisterMap:
    """Values of a device, and how they must be read.

    Parameters
    ----------
    base
        Number that the manual gives to the first register: 0, 1, or such as 40001.
    together
        Blocks that must not be split.
    heartbeat
        A counter that changes with each measurement of the device.
    time
        Time of the measurement by the device's own clock.
    signature
        Numbers that the device must hold before any value is used.
    max_registers
        Most registers in one read, 1 to 125.
    max_gap
        Unconfigured registers that may be read between two cells to save a request. If the device
        does not have one of them, the whole read fails.
    min_poll_period_s, min_timeout_s
        Limits of the manual.
    """

    values: tuple[MapValue, ...]
    base: int = 0
    together: tuple[Together, ...] = ()
    heartbeat: Cell | None = None
    time: DeviceTime | None = None
    signature: tuple[Signature, ...] = ()
    max_registers: int = MAX_REGISTERS_PER_READ
    max_gap: int = 0
    min_poll_period_s: float = 0.0
    min_timeout_s: float = 0.0
    ids: tuple[str, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.base not in BASES:
            words = ", ".join(map(str, BASES[:-1]))
            raise MapError(f"must be {words} or {BASES[-1]}, got {self.base}", "base")
        if not 1 <= self.max_registers <= MAX_REGISTERS_PER_READ:
            raise MapError(f"must be 1 to {MAX_REGISTERS_PER_READ}", "max_registers")
        if not 0 <= self.max_gap < MAX_REGISTERS_PER_READ:
            raise MapError(f"must be 0 to {MAX_REGISTERS_PER_READ - 1}", "max_gap")
        object.__setattr__(self, "ids", tuple(value.id for value in self.values))
        self._require_in_space()
        self._require_apart()

    def cells(self) -> Iterator[tuple[Cell, tuple[int | str, ...]]]:
        """Cells that are read in every poll, each with its place in the map."""
        for n, value in enumerate(self.values):
            yield from ((cell, ("value", n)) for cell in value.cells())
        if self.heartbeat is not None:
            yield self.heartbeat, ("heartbeat",)
        if self.time is not None:
            yield from ((cell, ("time",)) for cell in self.time.cells())

    def _require_in_space(self) -> None:
        """Refuse what no device can have, by its address."""
        places = [(cell.address, cell.n_places, at) for cell, at in self.cells()]
        for n, part in enumerate(self.signature):
            places.append((part.cell.address, part.cell.n_places, ("signature", n)))
        for n, block in enumerate(self.together):
            places.append((block.address, block.count, ("together", n)))
            if block.count > self.max_registers:
                limit = f"must not be above max_registers, {self.max_registers}"
                raise MapError(limit, "together", n, "count")
        for address, count, at in places:
            last = self.base + ADDRESS_SPACE - count
            if not self.base <= address <= last:
                words = f"must be {self.base} to {last}, since the map counts from {self.base}"
                raise MapError(words, *at, "address")

    def _require_apart(self) -> None:
        """Refuse two values on the same register, unless they are different bits of it."""
        taken: dict[tuple[int, int], MapValue] = {}
        for n, value in enumerate(self.values):
            cell = value.cell
            for place in range(cell.start(self.base), cell.stop(self.base)):
                other = taken.setdefault((cell.function, place), value)
                if other is not value and not _different_bits(cell, other.cell):
                    raise MapError(
                        f"lies on a register of value {other.id!r} (address"
                        f" {other.cell.address}, {other.cell.type}); each register has one value",
                        *("value", n, "address"),
                    )
        if len(set(self.ids)) < len(self.ids):
            twice = next(id_ for id_ in self.ids if self.ids.count(id_) > 1)
            raise MapError(f"has {twice!r} twice; each value must be unique", "value")


def _different_bits(one: Cell, other: Cell) -> bool:
    return NumberType.BIT is one.type is other.type and None is not one.bit != other.bit
