"""Trends of a bearing."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, TypeVar

from fastapi import APIRouter, Depends, Query, Response
from pydantic import Field

from core.condition.cells import CellGrid
from core.monitor.catalogue import BY_NAME
from core.units import NS_PER_S, ns_from_s
from service.api.answers import rendered, worked
from service.api.auth.declared import needs
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import States, TimeRange, eccentricity_range, oil_temperature_range
from service.api.problems import ProblemError, problem_responses
from service.api.routes.trend_groups import GroupName, TooManyGroupsError, TrendGroup, trend_groups
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import LEVEL_NAMES, ApiModel, LevelName, Time, states_named
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.port import Trend, TrendQuery, TrendSeries, ValueRange
from service.store.series import U_RANDOM, U_SYSTEMATIC, columns_of

T = TypeVar("T")


def trend_table(
    trend: Trend, groups: Sequence[TrendGroup] | None, past_end_ns: int | None
) -> list[Column]:
    """Return a trend as columns; with groups, their rows one after another.

    Parameters
    ----------
    past_end_ns
        End of the simulated past of the bearing.
    """
    parts = [trend] if groups is None else [group.trend for group in groups]
    times = [time_ns for part in parts for time_ns in part.time_ns]
    simulated = [past_end_ns is not None and time_ns <= past_end_ns for time_ns in times]
    columns = [Column("time_utc", "time", times), Column("is_simulated", "flag", simulated)]
    if groups is not None:
        names = [group.name for group in groups for _ in group.trend.time_ns]
        columns.insert(0, Column("group", "text", names))
    for name in filter(BY_NAME.__contains__, trend.series):
        columns += _columns(name, [part.series for part in parts])
    return columns


def _columns(name: str, parts: Sequence[Mapping[str, TrendSeries]]) -> Iterator[Column]:
    unit, own = BY_NAME[name].unit, [part[name] for part in parts]
    for kind in ("minimum", "maximum", "mean"):
        values = _joined(getattr(series, kind) for series in own)
        yield Column(f"{name}_{kind}", "number", values, unit)
    yield Column(f"{name}_count", "count", _joined(series.count for series in own))
    levels = _joined(series.worst_level for series in own)
    words = [None if level is None else LEVEL_NAMES[level] for level in levels]
    yield Column(f"{name}_worst_level", "text", words)
    for suffix in (U_RANDOM, U_SYSTEMATIC):
        if all(name + suffix in part for part in parts) and parts:
            values = _joined(part[name + suffix].mean for part in parts)
            yield Column(f"{name}_{suffix.lstrip('.')}", "number", values, unit)


def _joined(parts: Iterable[Sequence[T]]) -> list[T]:
    return [value for part in parts for value in part]


class TrendSeriesModel(ApiModel):
    """One quantity; one value per time."""

    unit: str
    """Unit and detector."""

    min: list[float | None]
    """Minimum of the usable readings; null if there are none."""

    max: list[float | None]
    """Maximum of the usable readings."""

    mean: list[float | None]
    """Mean of the usable readings."""

    count: list[int]
    """Number of usable readings."""

    worst_level: list[LevelName | None]
    """Worst quality in the bucket; null without readings."""

    u_random: list[float | None] | None
    """Mean random standard uncertainty; null for quantities without."""

    u_systematic: list[float | None] | None
    """Mean systematic standard uncertainty; null for quantities without."""


class TrendGroupModel(ApiModel):
    """Trends of the readings in one condition, by column."""

    name: Annotated[str, Field(examples=["full_load"])]
    """Operating state or bounds of the cell."""

    low: float | None
    """Lower bound of eccentricity ratio or oil temperature in °C; null for operating states."""

    high: float | None
    """Upper bound, likewise."""

    bucket_s: float | None
    """Width of the buckets, s; null for single readings."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    series: dict[str, TrendSeriesModel]
    """Requested quantities by name."""


class TrendModel(ApiModel):
    """Trends of one bearing, by column."""

    unit: str
    """Identifier of the unit."""

    bearing: str
    """Identifier of the bearing."""

    start: Time
    """Start of the requested range."""

    end: Time
    """End of the requested range."""

    bucket_s: float | None
    """Width of the buckets, s; null for single readings."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    series: dict[str, TrendSeriesModel]
    """Requested quantities by name."""

    simulated_until: Time | None
    """End of the simulated readings; null if all in this range are measured."""

    coarse_until: Time | None
    """End of the time whose single readings are deleted: only buckets cover it, and pages of single
    readings omit it; null if all in this range are kept."""

    next_cursor: Annotated[str | None, Field(examples=["1795248192400000000"])]
    """With ``cursor``, its value for the next page; null on the last page."""

    groups: list[TrendGroupModel] | None
    """With ``group_by``, trends of each operating state or cell with readings; readings whose
    condition is unknown are in none."""


def trend_model(
    query: TrendQuery,
    trend: Trend,
    groups: list[TrendGroup] | None = None,
    past_end_ns: int | None = None,
) -> TrendModel:
    """Return trends by column, and those of each condition if requested.

    Parameters
    ----------
    past_end_ns
        End of the simulated past of the bearing.
    """
    return TrendModel(
        unit=query.unit,
        bearing=query.bearing,
        start=rfc3339(query.start_ns),
        end=rfc3339(query.end_ns),
        bucket_s=bucket_s(trend),
        simulated_until=simulated_until(query, past_end_ns),
        coarse_until=None if trend.coarse_until_ns is None else rfc3339(trend.coarse_until_ns),
        next_cursor=None if trend.next_ns is None else str(trend.next_ns),
        time=times_s(trend),
        series=_series_models(trend),
        groups=None if groups is None else [_group_model(group) for group in groups],
    )


def simulated_until(query: TrendQuery, past_end_ns: int | None) -> str | None:
    """Return the end of the simulated readings of a range; None if all are measured."""
    if past_end_ns is None or past_end_ns < query.start_ns:
        return None
    return rfc3339(past_end_ns)


def _group_model(group: TrendGroup) -> TrendGroupModel:
    return TrendGroupModel(
        name=group.name,
        low=group.low,
        high=group.high,
        bucket_s=bucket_s(group.trend),
        time=times_s(group.trend),
        series=_series_models(group.trend),
    )


def bucket_s(trend: Trend) -> float | None:
    """Return the width of the buckets, s."""
    return None if trend.bucket_ns is None else trend.bucket_ns / NS_PER_S


def times_s(trend: Trend) -> list[float]:
    """Return the times in seconds since 1970."""
    return [time_ns / NS_PER_S for time_ns in trend.time_ns]


def _series_models(trend: Trend) -> dict[str, TrendSeriesModel]:
    return {name: _series_model(name, trend.series) for name in trend.series if name in BY_NAME}


def trend_columns(quantities: Iterable[str]) -> tuple[str, ...]:
    """Return the columns of the store that a trend of some quantities needs."""
    return columns_of(BY_NAME[name] for name in quantities)


def _series_model(name: str, columns: Mapping[str, TrendSeries]) -> TrendSeriesModel:
    series = columns[name]
    random, systematic = columns.get(name + U_RANDOM), columns.get(name + U_SYSTEMATIC)
    return TrendSeriesModel(
        unit=BY_NAME[name].unit,
        min=list(series.minimum),
        max=list(series.maximum),
        mean=list(series.mean),
        count=list(series.count),
        worst_level=[None if level is None else LEVEL_NAMES[level] for level in series.worst_level],
        u_random=list(random.mean) if random else None,
        u_systematic=list(systematic.mean) if systematic else None,
    )


MAX_POINTS = 5000
MAX_QUANTITIES = 40
HOLE_HOPS = 2.5
"""Distance of results, in result periods, above which there is a gap between them."""


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
    """Return the route of trends."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )
    reading = problem_responses(404, 422, 503)

    @router.get(
        "/{bearing}/trends",
        summary="Trends",
        response_model=TrendModel,
        responses={**reading, **table_content("Trends, by column")},
    )
    async def trends(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        wanted: Format,
        eccentricity: Annotated[ValueRange, Depends(eccentricity_range)],
        oil_temperature: Annotated[ValueRange, Depends(oil_temperature_range)],
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
            int,
            Query(ge=2, le=MAX_POINTS, description="More readings are combined in buckets."),
        ] = 1000,
        cursor: Cursor = None,
    ) -> Response:
        """List quantities over time: single readings, or buckets with extremes, mean and count.

        As CSV or Parquet: one row per time, with `group_by` per group and time.
        """
        context.bearing(unit, bearing)
        start_ns = _page_start_ns(cursor, group_by, times[0])
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
            return await rendered(lambda: trend_model(query, *read()))
        whole, groups, past = await worked(read)
        columns = await worked(lambda: trend_table(whole, groups, past))
        cursor = None if whole.next_ns is None else str(whole.next_ns)
        return table_response(wanted, columns, f"trends-{unit}-{bearing}", cursor)

    return router


def _read(
    context: Context, query: TrendQuery, group_by: GroupName | None, grid: CellGrid
) -> tuple[Trend, list[TrendGroup] | None, int | None]:
    """Return the trend, its groups, and the end of the simulated past."""
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    whole = context.store.trend(query)
    if group_by is None:
        return whole, None, past_end_ns
    try:
        return whole, trend_groups(context.store, query, group_by, grid), past_end_ns
    except TooManyGroupsError as error:
        raise ProblemError(422, "Wrong parameter", str(error), "group_by") from error


def _page_start_ns(cursor: str | None, group_by: GroupName | None, start_ns: int) -> int:
    """Return the start of the page."""
    if cursor is not None and group_by is not None:
        detail = "pages cannot be grouped: omit cursor or group_by"
        raise ProblemError(422, "Wrong parameter", detail, "cursor")
    return start_ns if cursor in (None, "first") else max(start_ns, int(cursor or 0))


def _known(quantities: list[str]) -> tuple[str, ...]:
    for name in quantities:
        if name not in BY_NAME:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
    return tuple(dict.fromkeys(quantities))
