"""Conditions and cells in the words of the API."""

import math
from typing import cast

from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions, OperatingPoint
from core.condition.operating_state import OperatingState
from service.api.film_models import CellModel, FilmConditionModel, OperatingStateName
from service.runtime.times import rfc3339

STATE_NAMES = {state: cast("OperatingStateName", state.name.lower()) for state in OperatingState}


def states_named(names: list[OperatingStateName] | None) -> tuple[OperatingState, ...]:
    """Operating states by name; nothing is any."""
    return tuple(OperatingState[name.upper()] for name in names or ())


def condition_model(
    time_ns: int, condition: BearingCondition, grid: CellGrid
) -> FilmConditionModel:
    """Under which condition a bearing runs."""
    return FilmConditionModel(
        time=rfc3339(time_ns),
        operating_state=STATE_NAMES[condition.state],
        is_settled=condition.is_settled,
        cell=None if condition.cell is None else cell_model(condition.cell, grid),
    )


def cell_of(point: OperatingPoint, grid: CellGrid) -> CellModel | None:
    """The cell that a point lies in; None where one of its axes is not known."""
    axes = (point.eccentricity_ratio, point.oil_temperature_c, point.attitude_deg)
    here = FilmConditions.one(*(math.nan if value is None else value for value in axes))
    if not grid.is_known(here)[0]:
        return None
    return cell_model(tuple(grid.cells(here)[:, 0].tolist()), grid)


def cell_model(cell: Cell, grid: CellGrid) -> CellModel:
    """Bounds of a cell."""
    eccentricity, temperature, *attitude = cell
    low_e, high_e = bounds(eccentricity, grid.eccentricity_width)
    low_c, high_c = bounds(temperature, grid.temperature_width_c)
    width_deg = grid.attitude_width_deg
    low_deg, high_deg = bounds(attitude[0], width_deg) if attitude and width_deg else (None, None)
    return CellModel(
        eccentricity_low=low_e,
        eccentricity_high=high_e,
        oil_temperature_low_c=low_c,
        oil_temperature_high_c=high_c,
        attitude_low_deg=low_deg,
        attitude_high_deg=high_deg,
    )


def bounds(number: int, width: float) -> tuple[float, float]:
    """Where a bin begins and ends; without the dust of binary fractions."""
    return round(number * width, 9), round((number + 1) * width, 9)
