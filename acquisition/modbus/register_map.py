"""`RegisterMap`: the values of one device, as its manual describes them.

The settings of a register map refuse what no device can have; nothing is checked here again.
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
    """State of a value by a status register: by its bits, or by its numbers.

    Parameters
    ----------
    mask
        Bits that count; numbers are shifted to its lowest bit before they are compared. 1 for a
        cell that is a single bit.
    set_means
        "bad": the value is bad if any of these bits is set. "ok": it is bad unless all are.
    ok_values
        Numbers of a good value, instead of `set_means`; all others are bad.
    clipped_values
        Numbers of a clipped value.
    """

    cell: Cell
    mask: int = 0xFFFF
    set_means: Meaning | None = None
    ok_values: tuple[int, ...] = ()
    clipped_values: tuple[int, ...] = ()

    @property
    def lowest_bit(self) -> int:
        """The lowest bit that counts, alone."""
        return self.mask & -self.mask


@dataclass(frozen=True, kw_only=True)
class ScaleRegister:
    """Register with the value of a full mantissa: value = raw / divisor * register."""

    cell: Cell
    divisor: float = 32767.0


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
        """Ids of the values, in their order."""
        return tuple(value.id for value in self.values)

    def cells(self) -> Iterator[Cell]:
        """Cells that are read in every poll."""
        for value in self.values:
            yield from value.cells()
        if self.heartbeat is not None:
            yield self.heartbeat
        if self.time is not None:
            yield from self.time.cells()
