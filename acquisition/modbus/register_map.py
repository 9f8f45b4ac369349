"""`RegisterMap`: the values of one device and their registers, as described in its manual.

The settings of a register map are validated when they are loaded, and not checked here again.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from acquisition.modbus.cells import Cell
from acquisition.modbus.device_time import DeviceTime
from acquisition.modbus.requests import MAX_REGISTERS_PER_READ


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
    time: DeviceTime | None = None
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
