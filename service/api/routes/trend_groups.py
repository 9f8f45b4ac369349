"""Trends grouped by operating state, or by intervals of eccentricity or oil temperature."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingState
from service.api.problems import ProblemError
from service.api.values import STATE_NAMES, bounds
from service.store.port import Trend, TrendQuery, ValueRange
from service.store.store import Store

GroupName = Literal["state", "eccentricity", "oil_temperature"]

MAX_GROUPS = 60

SURVEY_POINTS = 5000

BIN_TOLERANCE = 1e-9
"""If a value is closer to a bound than this, in bin widths, the bins on both sides are read."""


@dataclass(frozen=True)
class TrendGroup:
    """Trend of the readings in one operating state, or one interval of the grouping quantity.

    `name` is the operating state, or the bounds of the interval such as "0.35 to 0.4"; `low` and
    `high` are these bounds, in eccentricity ratio or °C, and None for operating states.
    """

    name: str
    low: float | None
    high: float | None
    trend: Trend


@dataclass(frozen=True)
class _Axis:
    """Axis of eccentricity ratio or oil temperature, divided into bins of equal width.

    Parameters
    ----------
    quantity
        Name of the quantity, which is also the field of `TrendQuery` with the requested range.
    width
        Width of a bin, in the unit of the quantity.
    """

    quantity: str
    width: float

    def narrowed(self, query: TrendQuery, low: float, high: float) -> TrendQuery:
        """Return the query limited to a bin: from `low`, included, to `high`, excluded."""
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
    """Return the trend of each group that contains readings, in the order of states or intervals.

    `by` is the quantity that determines the group of a reading; the grid of operating conditions
    gives the widths of the intervals. Raises `ProblemError` with status 422 if there are more than
    `MAX_GROUPS` groups.
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
    """Return the numbers of the bins that may contain readings, from a coarse trend.

    These are the bins between the minimum and the maximum of each bucket of the trend.
    """
    survey = replace(query, quantities=(axis.quantity,), max_points=SURVEY_POINTS)
    series = store.trend(survey).series[axis.quantity]
    bins: set[int] = set()
    for low, high in zip(series.minimum, series.maximum, strict=True):
        if low is not None and high is not None:
            first = math.floor(low / axis.width - BIN_TOLERANCE)
            last = math.floor(high / axis.width + BIN_TOLERANCE)
            bins |= set(range(first, min(last, first + MAX_GROUPS) + 1))
    if len(bins) > MAX_GROUPS:
        detail = f"more than {MAX_GROUPS} groups; request a narrower range"
        raise ProblemError(422, "Wrong parameter", detail, "group_by")
    return sorted(bins)
