"""Route for trends: quantities of a bearing over time."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, TypeVar

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from core.condition.cells import CellGrid
from core.monitor.catalogue import Quantity, quantity_named
from core.units import NS_PER_S, ns_from_s
from service.api.answers import in_thread
from service.api.auth.declared import subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import Eccentricity, OilTemperature, States, TimeRange
from service.api.problems import ProblemError
from service.api.routes.trend_groups import GroupName, TrendGroup, trend_groups
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import (
    ApiModel,
    BearingHistory,
    LevelName,
    Time,
    level_names,
    states_named,
)
from service.runtime.times import rfc3339
from service.store.port import Trend, TrendQuery, TrendSeries
from service.store.series import U_RANDOM, U_SYSTEMATIC, columns_of

T = TypeVar("T")


def trend_table(
    trend: Trend, groups: Sequence[TrendGroup] | None, past_end_ns: int | None
) -> list[Column]:
    """Return a trend as table columns.

    Parameters
    ----------
    trend
        Trend of all readings in the time range.
    groups
        Groups whose rows are returned, one group after the other; None to return the rows of the
        trend itself.
    past_end_ns
        End of the simulated readings, ns since 1970 UTC; None without simulated readings.
    """
    parts = [trend] if groups is None else [group.trend for group in groups]
    times = [time_ns for part in parts for time_ns in part.time_ns]
    simulated = [past_end_ns is not None and time_ns <= past_end_ns for time_ns in times]
    columns = [Column("time_utc", "time", times), Column("is_simulated", "flag", simulated)]
    if groups is not None:
        names = [group.name for group in groups for _ in group.trend.time_ns]
        columns.insert(0, Column("group", "text", names))
    for quantity in _quantities(trend.series):
        columns += _columns(quantity, [part.series for part in parts])
    return columns


def _quantities(names: Iterable[str]) -> Iterator[Quantity]:
    """Yield the quantities among column names, which also name uncertainties."""
    yield from filter(None, map(quantity_named, names))


def _columns(quantity: Quantity, parts: Sequence[Mapping[str, TrendSeries]]) -> Iterator[Column]:
    name, unit, own = quantity.name, quantity.unit, [part[quantity.name] for part in parts]
    for kind in ("minimum", "maximum", "mean"):
        values = _joined(getattr(series, kind) for series in own)
        yield Column(f"{name}_{kind}", "number", values, unit)
    yield Column(f"{name}_count", "count", _joined(series.count for series in own))
    levels = _joined(series.worst_level for series in own)
    yield Column(f"{name}_worst_level", "text", level_names(levels))
    for suffix in (U_RANDOM, U_SYSTEMATIC):
        if all(name + suffix in part for part in parts) and parts:
            values = _joined(part[name + suffix].mean for part in parts)
            yield Column(f"{name}_{suffix.lstrip('.')}", "number", values, unit)


def _joined(parts: Iterable[Sequence[T]]) -> list[T]:
    return [value for part in parts for value in part]


class TrendSeriesModel(ApiModel):
    """Values of one quantity over time; every list has one value per time."""

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

    time: list[Time]
    """Time of each reading or start of each bucket."""

    series: dict[str, TrendSeriesModel]
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

    simulated_until: Time | None

    coarse_until: Time | None
    """End of the part of the range whose single readings were deleted by retention, so that only
    buckets are available; null if all single readings in the range are stored."""

    next_cursor: Annotated[str | None, Field(examples=["1795248192400000000"])]
    """Parameter ``cursor`` for the next page of single readings; null if there is none."""

    groups: list[TrendGroupModel] | None
    """Trends of each group with readings; null without ``group_by``. Readings whose grouping
    quantity is unknown belong to no group."""


def trend_answer(
    query: TrendQuery,
    trend: Trend,
    groups: list[TrendGroup] | None = None,
    past_end_ns: int | None = None,
) -> dict[str, object]:
    """Return trends as a JSON object with the fields of `TrendModel`; its lists are not validated.

    Parameters
    ----------
    query, trend
        Query of the client, and the trend of all readings that it selects.
    groups
        Groups of readings with their trends; None if not requested.
    past_end_ns
        End of the simulated readings, ns since 1970 UTC; None without simulated readings.
    """
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "start": rfc3339(query.start_ns),
        "end": rfc3339(query.end_ns),
        **_columns_of(trend),
        "simulated_until": simulated_until(query, past_end_ns),
        "coarse_until": None if trend.coarse_until_ns is None else rfc3339(trend.coarse_until_ns),
        "next_cursor": None if trend.next_ns is None else str(trend.next_ns),
        "groups": groups
        and [
            {"name": g.name, "low": g.low, "high": g.high, **_columns_of(g.trend)} for g in groups
        ],
    }


def simulated_until(query: TrendQuery, past_end_ns: int | None) -> str | None:
    """Return the end `past_end_ns` of simulated readings, RFC 3339; None if the range has none."""
    if past_end_ns is None or past_end_ns < query.start_ns:
        return None
    return rfc3339(past_end_ns)


def _columns_of(trend: Trend) -> dict[str, object]:
    series = {each.name: _series(each, trend.series) for each in _quantities(trend.series)}
    bucket_s = trend.bucket_ns and trend.bucket_ns / NS_PER_S
    return {"bucket_s": bucket_s, "time": [*map(rfc3339, trend.time_ns)], "series": series}


def trend_columns(quantities: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the stored columns of quantities: values, and their uncertainties."""
    return columns_of(_quantities(quantities))


def _series(quantity: Quantity, columns: Mapping[str, TrendSeries]) -> dict[str, object]:
    name, series = quantity.name, columns[quantity.name]
    random, systematic = columns.get(name + U_RANDOM), columns.get(name + U_SYSTEMATIC)
    return {
        "unit": quantity.unit,
        "minimum": series.minimum,
        "maximum": series.maximum,
        "mean": series.mean,
        "count": series.count,
        "worst_level": level_names(series.worst_level),
        "u_random": random.mean if random else None,
        "u_systematic": systematic.mean if systematic else None,
    }


MaxPoints = Annotated[
    int,
    Query(
        ge=2,
        le=5000,
        description="Maximum number of points; more readings are combined in buckets.",
    ),
]
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
        max_points: MaxPoints = 1000,
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
            quantities=trend_columns(_known(quantity)),
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
        read = partial(_read, context, query, group_by, grid)
        if wanted == "json":
            revision = partial(context.past_revision, unit, times)

            def make() -> dict[str, object]:
                return trend_answer(query, *read())

            lasting = None if "last" in request.query_params else lambda _: make
            return await context.answers.of(request, revision, make, lasting)
        whole, groups, past = await in_thread(read)
        columns = await in_thread(lambda: trend_table(whole, groups, past))
        cursor = None if whole.next_ns is None else str(whole.next_ns)
        return table_response(wanted, columns, f"trends-{unit}-{bearing}", cursor)

    return router


def _read(
    context: Context, query: TrendQuery, group_by: GroupName | None, grid: CellGrid
) -> tuple[Trend, list[TrendGroup] | None, int | None]:
    """Return the trend, its groups or None, and the end of the simulated readings or None."""
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    whole = context.store.trend(query)
    groups = None if group_by is None else trend_groups(context.store, query, group_by, grid)
    return whole, groups, past_end_ns


def _known(quantities: list[str]) -> tuple[str, ...]:
    for name in quantities:
        if quantity_named(name) is None:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
    return tuple(dict.fromkeys(quantities))
