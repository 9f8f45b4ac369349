"""From the settings of a register map to the plain values that adapters take.

What only the map as a whole can decide is refused here: the function of a cell that names none, and
addresses, which count from the map's base.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.modbus.cells import ByteOrder, Cell, NumberType
from acquisition.modbus.register_map import FlagCheck, FullScale, MapValue, ScaleRegister
from acquisition.modbus.requests import ADDRESS_SPACE, REGISTER_FUNCTIONS
from service.settings.base import MisfitError
from service.settings.register_values import (
    CellSettings,
    FlagSettings,
    FullScaleSettings,
    ScaleRegisterSettings,
    ValueSettings,
)


@dataclass(frozen=True)
class MapDefaults:
    """What a map says for all cells that do not say it themselves, and where it counts from.

    All methods raise `MisfitError` with the place in the map.
    """

    base: int
    function: int
    byte_order: ByteOrder

    def require_in_space(self, address: int, count: int, *at: int | str) -> None:
        """Refuse registers that no device can have, by their address."""
        last = self.base + ADDRESS_SPACE - count
        if not self.base <= address <= last:
            words = f"must be {self.base} to {last}, since the map counts from {self.base}"
            raise MisfitError(words, *at, "address")

    def cell(self, settings: CellSettings, *at: int | str) -> Cell:
        """Build a cell."""
        cell = Cell(
            address=settings.address,
            function=settings.function or self.function,
            type=settings.type,
            byte_order=settings.byte_order or self.byte_order,
            bit=settings.bit,
        )
        is_bit, in_register = cell.type is NumberType.BIT, cell.function in REGISTER_FUNCTIONS
        if not in_register and not is_bit:
            words = 'must be "bit": functions 1 and 2 read single bits'
            raise MisfitError(words, *at, "type")
        if (cell.bit is not None) != (is_bit and in_register):
            raise MisfitError(
                'is the number of a bit in a register: give it with type "bit" and function 3 or 4,'
                " and only then",
                *(*at, "bit"),
            )
        self.require_in_space(cell.address, cell.n_places, *at)
        return cell

    def value(self, settings: ValueSettings, *at: int | str) -> MapValue:
        """Build a value, in padwatch's conventions: zero-to-peak, degrees of lead."""
        low, high = settings.invalid_below, settings.invalid_above
        return MapValue(
            id=settings.id,
            cell=self.cell(settings, *at),
            scale=settings.scale * settings.rim_factor,
            offset=settings.offset * settings.rim_factor,
            scale_register=self._scale_register(settings.scale_register, *at, "scale_register"),
            full_scale=self._full_scale(settings.full_scale, *at, "full_scale"),
            flags=tuple(self._flag(f, *at, "flag", n) for n, f in enumerate(settings.flag)),
            invalid_values=settings.invalid_values,
            invalid_below=-math.inf if low is None else low,
            invalid_above=math.inf if high is None else high,
        )

    def _scale_register(
        self, scale: ScaleRegisterSettings | None, *at: int | str
    ) -> ScaleRegister | None:
        if scale is None:
            return None
        return ScaleRegister(cell=self.cell(scale, *at), divisor=scale.divisor)

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
    """Refuse two values on the same register, unless they are different bits of it.

    Raises
    ------
    MisfitError
        With the place of the second one.
    """
    taken: dict[tuple[int, int], MapValue] = {}
    for n, value in enumerate(values):
        cell = value.cell
        for place in range(cell.start(base), cell.stop(base)):
            other = taken.setdefault((cell.function, place), value)
            if other is not value and not _are_different_bits(cell, other.cell):
                raise MisfitError(
                    f"lies on a register of value {other.id!r} (address {other.cell.address},"
                    f" {other.cell.type}); each register has one value",
                    *("value", n, "address"),
                )
        if value.id in [other.id for other in values[:n]]:
            raise MisfitError(f"has {value.id!r} twice; each value must be unique", "value")


def _are_different_bits(one: Cell, other: Cell) -> bool:
    return NumberType.BIT is one.type is other.type and None is not one.bit != other.bit
