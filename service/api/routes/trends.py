"""Route for trends: quantities of a bearing over time."""

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from core.condition.cells import CellGrid
from core.monitor.catalogue import quantity_named
from core.units import ns_from_s
from service.api.auth.gate import subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import Eccentricity, OilTemperature, States, TimeRange, at_most
from service.api.problems import ProblemError
from service.api.routes.trend_groups import (
    GroupName,
    QuantityTrend,
    TrendColumns,
    TrendGroupModel,
    columns_of,
    quantities_among,
    trend_groups,
)
from service.api.tables import Column, ColumnKind, Format, table_content, table_response
from service.api.values import BearingHistory, Time, TimeNs, states_named
from service.store.port import Trend, TrendQuery
from service.store.series import columns_of as stored_columns


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


def trend_router(context: Context) -> APIRouter:
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
        context.bearing(unit, bearing)
        if cursor is not None and group_by is not None:
            detail = "cursor and group_by cannot be combined; omit one"
            raise ProblemError(422, "Wrong parameter", detail, "cursor")
        start_ns = max(times[0], int(cursor)) if cursor and cursor != "first" else times[0]
        query = TrendQuery(
            unit=unit,
            bearing=bearing,
            quantities=stored_columns(quantities_among(_known(quantity))),
            start_ns=start_ns,
            end_ns=times[1],
            max_points=max_points,
            hole_ns=ns_from_s(HOLE_HOPS * context.refresh_s),
            eccentricity_ratio=eccentricity,
            oil_temperature_c=oil_temperature,
            states=states_named(state),
            is_page=cursor is not None,
        )
        grid = context.films.settings.baseline.settings().grid
        make = partial(_read, context, query, group_by, grid)
        if wanted == "json":
            revision = partial(context.past_revision, unit, times)
            is_fixed = "last" not in request.query_params  # otherwise the range ends now
            return await context.answers.of(request, revision, make, is_polled=is_fixed)
        found = await asyncio.to_thread(make)
        columns = await asyncio.to_thread(trend_table, found)
        return table_response(wanted, columns, f"trends-{unit}-{bearing}", found.next_cursor)

    return router


def _read(
    context: Context, query: TrendQuery, group_by: GroupName | None, grid: CellGrid
) -> TrendModel:
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    whole = context.store.trend(query)
    groups = None if group_by is None else trend_groups(context.store, query, group_by, grid)
    return trend_model(query, whole, groups, past_end_ns)


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
        columns_of(trend),
        trend,
        simulated_until=past_end_ns if is_past else None,
        next_cursor=None if trend.next_ns is None else str(trend.next_ns),
        groups=groups,
    )


def _known(quantities: list[str]) -> tuple[str, ...]:
    for name in quantities:
        if quantity_named(name) is None:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
    return tuple(dict.fromkeys(quantities))
