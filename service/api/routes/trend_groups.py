"""Trends grouped by operating state, or by condition cell along one axis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingState
from service.api.values import STATE_NAMES, bounds
from service.store.port import Trend, TrendQuery, ValueRange
from service.store.store import Store

GroupName = Literal["state", "eccentricity", "oil_temperature"]

MAX_GROUPS = 60

SURVEY_POINTS = 5000

BIN_TOLERANCE = 1e-9
"""Distance from the bound between two bins, in bin widths, within which both bins are read."""


class TooManyGroupsError(ValueError):
    """Raised for more than `MAX_GROUPS` groups; the message gives the limit."""


@dataclass(frozen=True)
class TrendGroup:
    """Trend of the readings in one operating state or condition cell.

    Parameters
    ----------
    low, high
        Bounds of the cell; None for operating states.
    """

    name: str
    low: float | None
    high: float | None
    trend: Trend


@dataclass(frozen=True)
class _Axis:
    """Axis of eccentricity or temperature, divided into bins.

    Parameters
    ----------
    quantity
        Name of the quantity, and of the field of `TrendQuery` with its range.
    """

    quantity: str
    width: float

    def narrowed(self, query: TrendQuery, low: float, high: float) -> TrendQuery:
        """Return the query limited to one bin, which includes its lower but not its upper bound."""
        requested, below = getattr(query, self.quantity), math.nextafter(high, -math.inf)
        within = ValueRange(
            low if requested.low is None else max(low, requested.low),
            below if requested.high is None else min(below, requested.high),
        )
        changed: dict[str, Any] = {self.quantity: within}
        return replace(query, **changed)


def trend_groups(
    store: Store, query: TrendQuery, by: GroupName, grid: CellGrid
) -> list[TrendGroup]:
    """Read the trend of each group that contains readings.

    Raises
    ------
    TooManyGroupsError
        If there are more than `MAX_GROUPS` groups.
    """
    if by == "state":
        found = _by_state(store, query)
    elif by == "eccentricity":
        found = _by_cell(store, query, _Axis("eccentricity_ratio", grid.eccentricity_width))
    else:
        found = _by_cell(store, query, _Axis("oil_temperature_c", grid.temperature_width_c))
    return [group for group in found if group.trend.time_ns]


def _by_state(store: Store, query: TrendQuery) -> Iterator[TrendGroup]:
    for state in query.states or tuple(OperatingState):
        trend = store.trend(replace(query, states=(state,)))
        yield TrendGroup(STATE_NAMES[state], None, None, trend)


def _by_cell(store: Store, query: TrendQuery, axis: _Axis) -> Iterator[TrendGroup]:
    for number in _bins(store, query, axis):
        low, high = bounds(number, axis.width)
        trend = store.trend(axis.narrowed(query, low, high))
        yield TrendGroup(f"{low:g} to {high:g}", low, high, trend)


def _bins(store: Store, query: TrendQuery, axis: _Axis) -> list[int]:
    """Return the numbers of the bins between minimum and maximum of any bucket."""
    survey = replace(query, quantities=(axis.quantity,), max_points=SURVEY_POINTS)
    series = store.trend(survey).series[axis.quantity]
    bins: set[int] = set()
    for low, high in zip(series.minimum, series.maximum, strict=True):
        if low is not None and high is not None:
            first = math.floor(low / axis.width - BIN_TOLERANCE)
            last = math.floor(high / axis.width + BIN_TOLERANCE)
            bins |= set(range(first, min(last, first + MAX_GROUPS) + 1))
    if len(bins) > MAX_GROUPS:
        raise TooManyGroupsError(f"more than {MAX_GROUPS} groups: request a narrower range")
    return sorted(bins)
