"""Route for trends: quantities of a bearing over time, also grouped by operating condition."""

import asyncio
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Annotated, Any, Literal

from fastapi import Query, Request, Response
from pydantic import Field

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingState
from core.monitor.catalogue import Quantity, quantity_named
from core.units import NS_PER_S, ns_from_s
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import Eccentricity, OilTemperature, States, TimeRange, at_most
from service.api.problems import ProblemError
from service.api.tables import Column, ColumnKind, Format, table_content, table_response
from service.api.values import (
    LEVEL_NAMES,
    STATE_NAMES,
    ApiModel,
    BearingHistory,
    LevelName,
    Time,
    TimeNs,
    bounds,
    states_named,
)
from service.runtime.models import SERVED
from service.store.port import Trend, TrendQuery, TrendSeries, ValueRange
from service.store.series import U_RANDOM, U_SYSTEMATIC, columns_of
from service.store.store import Store

GroupName = Literal["state", "eccentricity", "oil_temperature"]


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


class TrendModel(TrendColumns, BearingHistory):
    """Trends of quantities of one bearing in a time range."""

    simulated_until: TimeNs | None

    coarse_until: Time | None
    """End of the part of the range whose single readings were deleted by retention, so that only
    buckets are available; null if all single readings in the range are stored."""

    next_cursor: Annotated[str | None, Field(examples=["1795248192400000000"])]
    """Parameter ``cursor`` for the next page of single readings; null if there is none."""

    groups: list[TrendGroupModel] | None
    """Trends of each group with readings; null without ``group_by``. Readings whose grouping
    quantity is unknown belong to no group."""


MAX_GROUPS = 60

SURVEY_POINTS = 5000

BIN_TOLERANCE = 1e-9
"""If a value is closer to a bound than this, in bin widths, the bins on both sides are read."""


def _columns_of(trend: Trend) -> dict[str, Any]:
    """Return the fields of `TrendColumns` except the times, which the trend has."""
    quantities = filter(None, map(quantity_named, trend.series))  # not the uncertainties
    return {
        "bucket_s": trend.bucket_ns and trend.bucket_ns / NS_PER_S,
        "series": {each.name: _series(each, trend.series) for each in quantities},
    }


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
    found = []
    for name, low, high, part in _parts(store, query, by, grid):
        if (trend := store.trend(part)).time_ns:
            columns = _columns_of(trend)
            found.append(TrendGroupModel.of(trend, name=name, low=low, high=high, **columns))
    return found


def _parts(
    store: Store, query: TrendQuery, by: GroupName, grid: CellGrid
) -> Iterator[tuple[str, float | None, float | None, TrendQuery]]:
    """Yield name, lower bound, upper bound and query of each group."""
    if by == "state":
        for state in query.states or tuple(OperatingState):
            yield STATE_NAMES[state], None, None, replace(query, states=(state,))
        return
    quantity, field = AXES[by]
    width = getattr(grid, field)
    for number in _bins(store, query, quantity, width):
        low, high = bounds(number, width)
        yield f"{low:g} to {high:g}", low, high, _narrowed(query, quantity, low, high)


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


def trend_table(found: TrendModel) -> list[Column]:
    """Return a trend as table columns; with groups, the rows of one group after the other."""
    parts: Sequence[TrendColumns] = [found] if found.groups is None else found.groups
    times = [time_ns for part in parts for time_ns in part.time]
    end_ns = found.simulated_until
    simulated = [end_ns is not None and time_ns <= end_ns for time_ns in times]
    columns = [Column("time_utc", "time", times), Column("is_simulated", "flag", simulated)]
    if found.groups is not None:
        names = [group.name for group in found.groups for _ in group.time]
        columns.insert(0, Column("group", "text", names))
    for name, series in found.series.items():
        columns += _columns(name, series.unit, [part.series[name] for part in parts])
    return columns


OTHER_KINDS: dict[str, ColumnKind] = {"count": "count", "worst_level": "text"}
"""Kinds of table columns whose values are not numbers in the unit of the quantity."""


def _columns(name: str, unit: str, parts: Sequence[QuantityTrend]) -> Iterator[Column]:
    for field in fields(QuantityTrend)[1:]:  # all except the unit
        lists = [getattr(part, field.name) for part in parts]
        if None in lists or (not lists and field.name.startswith("u_")):
            continue
        values = [value for each in lists for value in each]
        kind = OTHER_KINDS.get(field.name, "number")
        yield Column(f"{name}_{field.name}", kind, values, unit if kind == "number" else None)


MAX_POINTS = 5000
MAX_QUANTITIES = 40
HOLE_HOPS = 2.5
"""Maximum time between successive results that a trend shows without a gap, in result periods."""

Cursor = Annotated[
    str | None,
    Query(
        pattern=r"^(first|[0-9]{1,19})$",
        description="Pages of single readings, oldest first, in place of buckets: `first`, then"
        " `next_cursor` of the previous page.",
        examples=["first"],
    ),
]


def trend_router(context: Context) -> GuardedRouter:
    """Return the router for trends."""
    router = subject_router("/units/{unit}/bearings", "bearing")

    @router.get(
        "/{bearing}/trends", response_model=TrendModel, responses=table_content("Trends, by column")
    )
    async def trends(
        request: Request,
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        wanted: Format,
        eccentricity: Eccentricity,
        oil_temperature: OilTemperature,
        quantity: Annotated[
            list[str],
            Query(
                min_length=1,
                max_length=MAX_QUANTITIES,
                description="Names from the catalogue; may be repeated.",
                examples=[["order1_k_eff_xx_n_per_m", "speed_rpm"]],
            ),
        ],
        state: States = None,
        group_by: Annotated[
            GroupName | None,
            Query(
                description="Add a trend for each operating state, or for each cell along"
                " eccentricity or oil temperature.",
                examples=["state"],
            ),
        ] = None,
        max_points: Annotated[
            int, at_most(MAX_POINTS, "points; more readings are combined in buckets", minimum=2)
        ] = 1000,
        cursor: Cursor = None,
    ) -> Response:
        """Return trends as single readings, or as minimum, maximum and mean of time intervals.

        As CSV or Parquet: one row per time; with `group_by`, one row per group and time.
        """
        if cursor is not None and group_by is not None:
            detail = "cursor and group_by cannot be combined; omit one"
            raise ProblemError(422, "Wrong parameter", detail, "cursor")
        start_ns = max(times[0], int(cursor)) if cursor and cursor != "first" else times[0]
        query = TrendQuery(
            unit=unit,
            bearing=bearing,
            quantities=columns_of(_known(quantity)),
            start_ns=start_ns,
            end_ns=times[1],
            max_points=max_points,
            hole_ns=ns_from_s(HOLE_HOPS * context.refresh_s),
            eccentricity_ratio=eccentricity,
            oil_temperature_c=oil_temperature,
            states=states_named(state),
            is_page=cursor is not None,
        )

        def read() -> TrendModel:
            store, grid = context.store, context.films.grid
            past_end_ns, trend = store.films.past_end_ns(unit, bearing), store.trend(query)
            groups = None if group_by is None else trend_groups(store, query, group_by, grid)
            return trend_model(query, trend, groups, past_end_ns)

        if wanted == "json":
            revision = partial(context.past_revision, unit, times)
            is_fixed = "last" not in request.query_params  # otherwise the range ends now
            return await context.answers.of(request, revision, read, is_polled=is_fixed)
        found = await asyncio.to_thread(read)
        columns = await asyncio.to_thread(trend_table, found)
        return table_response(wanted, columns, f"trends-{unit}-{bearing}", found.next_cursor)

    return router


def trend_model(
    query: TrendQuery,
    trend: Trend,
    groups: list[TrendGroupModel] | None = None,
    past_end_ns: int | None = None,
) -> TrendModel:
    """Return the API model of the trend that a query selects.

    `groups` are None if not requested; `past_end_ns` is the end of the simulated readings, ns since
    1970 UTC, None without simulated readings.
    """
    is_past = past_end_ns is not None and past_end_ns >= query.start_ns
    return TrendModel.of(
        query,
        trend,
        **_columns_of(trend),
        simulated_until=past_end_ns if is_past else None,
        next_cursor=None if trend.next_ns is None else str(trend.next_ns),
        groups=groups,
    )


def _known(names: list[str]) -> Iterator[Quantity]:
    for name in dict.fromkeys(names):
        found = quantity_named(name)
        if found is None:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
        yield found
