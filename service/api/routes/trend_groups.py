"""Trends grouped by operating state, or by intervals of eccentricity or oil temperature."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import Field

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingState
from core.monitor.catalogue import Quantity, quantity_named
from core.units import NS_PER_S
from service.api.problems import ProblemError
from service.api.values import LEVEL_NAMES, STATE_NAMES, ApiModel, LevelName, TimeNs, bounds
from service.runtime.models import SERVED
from service.store.port import Trend, TrendQuery, TrendSeries, ValueRange
from service.store.series import U_RANDOM, U_SYSTEMATIC
from service.store.store import Store

GroupName = Literal["state", "eccentricity", "oil_temperature"]

MAX_GROUPS = 60

SURVEY_POINTS = 5000

BIN_TOLERANCE = 1e-9
"""If a value is closer to a bound than this, in bin widths, the bins on both sides are read."""


@dataclass(frozen=True)
class QuantityTrend:
    """Values of one quantity over time; every list has one value per time."""

    __pydantic_config__ = SERVED

    unit: str
    """Unit of the values; for an amplitude, also the detector."""

    minimum: list[float | None]
    """Minimum of the usable readings; null without usable readings."""

    maximum: list[float | None]
    """Maximum of the usable readings; null without usable readings."""

    mean: list[float | None]
    """Mean of the usable readings; null without usable readings."""

    count: list[int]
    """Number of usable readings."""

    worst_level: list[LevelName | None]
    """Worst quality level of the readings; null without readings."""

    u_random: list[float | None] | None
    """Mean of the random standard uncertainties; null for a quantity without uncertainty."""

    u_systematic: list[float | None] | None
    """Mean of the systematic standard uncertainties; null for a quantity without uncertainty."""


class TrendColumns(ApiModel):
    """Trends of several quantities at common times."""

    bucket_s: float | None
    """Width of the time intervals (buckets) that combine readings, s; null for single readings."""

    time: list[TimeNs]
    """Time of each reading or start of each bucket."""

    series: dict[str, QuantityTrend]
    """Values of the requested quantities, by name of the quantity."""


class TrendGroupModel(TrendColumns):
    """Trends of the readings in one operating state, or one interval of a grouping quantity."""

    name: Annotated[str, Field(examples=["full_load"])]
    """Name of the group: operating state, or bounds of the interval."""

    low: float | None
    """Lower bound of eccentricity ratio, or oil temperature in °C; null for operating states."""

    high: float | None
    """Upper bound of eccentricity ratio, or oil temperature in °C; null for operating states."""


def columns_of(trend: Trend) -> TrendColumns:
    """Return the API model of the columns of a trend."""
    return TrendColumns.of(
        trend,
        bucket_s=trend.bucket_ns and trend.bucket_ns / NS_PER_S,
        series={each.name: _series(each, trend.series) for each in quantities_among(trend.series)},
    )


def quantities_among(names: Iterable[str]) -> Iterator[Quantity]:
    """Yield the quantities among column names, which also name uncertainties."""
    yield from filter(None, map(quantity_named, names))


def _series(quantity: Quantity, columns: Mapping[str, TrendSeries]) -> QuantityTrend:
    series, uncertainties = vars(columns[quantity.name]), {}
    for suffix in (U_RANDOM, U_SYSTEMATIC):
        found = columns.get(quantity.name + suffix)
        uncertainties[suffix.lstrip(".")] = found and found.mean
    levels = [LEVEL_NAMES.get(level) for level in series["worst_level"]]
    return QuantityTrend(quantity.unit, **series | uncertainties | {"worst_level": levels})


AXES: dict[GroupName, tuple[str, str]] = {
    "eccentricity": ("eccentricity_ratio", "eccentricity_width"),
    "oil_temperature": ("oil_temperature_c", "temperature_width_c"),
}
"""Grouping quantity, as in `TrendQuery`, and field of `CellGrid` with the width of its bins."""


def trend_groups(
    store: Store, query: TrendQuery, by: GroupName, grid: CellGrid
) -> list[TrendGroupModel]:
    """Return the trend of each group that contains readings, in the order of states or intervals.

    `by` is the quantity that determines the group of a reading; the grid of operating conditions
    gives the widths of the intervals. Raises `ProblemError` with status 422 if there are more than
    `MAX_GROUPS` groups.
    """
    if by == "state":
        found = _by_state(store, query)
    else:
        quantity, width = AXES[by]
        found = _by_cell(store, query, quantity, getattr(grid, width))
    return [group for group in found if group.time]


def _by_state(store: Store, query: TrendQuery) -> Iterator[TrendGroupModel]:
    for state in query.states or tuple(OperatingState):
        trend = columns_of(store.trend(replace(query, states=(state,))))
        yield TrendGroupModel.of(trend, name=STATE_NAMES[state], low=None, high=None)


def _by_cell(
    store: Store, query: TrendQuery, quantity: str, width: float
) -> Iterator[TrendGroupModel]:
    for number in _bins(store, query, quantity, width):
        low, high = bounds(number, width)
        trend = columns_of(store.trend(_narrowed(query, quantity, low, high)))
        yield TrendGroupModel.of(trend, name=f"{low:g} to {high:g}", low=low, high=high)


def _narrowed(query: TrendQuery, quantity: str, low: float, high: float) -> TrendQuery:
    """Return the query limited to a quantity from `low`, included, to `high`, excluded."""
    requested, below = getattr(query, quantity), math.nextafter(high, -math.inf)
    within = ValueRange(
        low if requested.low is None else max(low, requested.low),
        below if requested.high is None else min(below, requested.high),
    )
    changed: dict[str, Any] = {quantity: within}
    return replace(query, **changed)


def _bins(store: Store, query: TrendQuery, quantity: str, width: float) -> list[int]:
    """Return the numbers of the bins that may contain readings, from a coarse trend.

    These are the bins between the minimum and the maximum of each bucket of the trend.
    """
    survey = replace(query, quantities=(quantity,), max_points=SURVEY_POINTS)
    series = store.trend(survey).series[quantity]
    bins: set[int] = set()
    for low, high in zip(series.minimum, series.maximum, strict=True):
        if low is not None and high is not None:
            first = math.floor(low / width - BIN_TOLERANCE)
            last = math.floor(high / width + BIN_TOLERANCE)
            bins |= set(range(first, min(last, first + MAX_GROUPS) + 1))
    if len(bins) > MAX_GROUPS:
        detail = f"more than {MAX_GROUPS} groups; request a narrower range"
        raise ProblemError(422, "Wrong parameter", detail, "group_by")
    return sorted(bins)
