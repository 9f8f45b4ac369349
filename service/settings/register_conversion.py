"""From the settings of a register map to the plain values that adapters take."""

import math
from dataclasses import dataclass

from acquisition.modbus.cells import ByteOrder, Cell, MapError
from acquisition.modbus.register_map import FlagCheck, FullScale, MapValue, ScaleRegister
from service.settings.register_values import (
    CellSettings,
    FlagSettings,
    FullScaleSettings,
    ScaleRegisterSettings,
    ValueSettings,
)


@dataclass(frozen=True)
class CellDefaults:
    """What a map says for all cells that do not say it themselves."""

    function: int
    byte_order: ByteOrder

    def cell(self, cell: CellSettings, *at: int | str) -> Cell:
        """Build a cell.

        Raises
        ------
        MapError
            If there can be no such cell; says where in the map.
        """
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

        Raises
        ------
        MapError
            If there can be no such value; says where in the map.
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
