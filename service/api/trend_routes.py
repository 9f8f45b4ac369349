"""Trends of a bearing, whole or parted by condition."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from core.condition.cells import CellGrid
from core.monitor.catalogue import BY_NAME
from core.units import ns_from_s
from service.api.auth.declared import needs
from service.api.bearing_routes import TimeRange, eccentricity_range, oil_temperature_range
from service.api.context import BearingId, Context, UnitId
from service.api.film_conditions import states_named
from service.api.film_routes import States
from service.api.problems import ProblemError, problem_responses
from service.api.rendering import rendered, worked
from service.api.series_models import TrendModel
from service.api.tables import Format, table_content, table_response
from service.api.trend_groups import GroupName, TooManyGroupsError, TrendGroup, trend_groups
from service.api.trend_tables import trend_table
from service.api.trend_views import trend_columns, trend_model
from service.store.access.identities import Permission
from service.store.port import Trend, TrendQuery
from service.store.value_range import ValueRange

MAX_POINTS = 5000
MAX_QUANTITIES = 40
HOLE_HOPS = 2.5
"""Results further apart than this many refreshes have a hole between them."""


Cursor = Annotated[
    str | None,
    Query(
        pattern=r"^(first|[0-9]{1,19})$",
        description="Pages of single readings, oldest first, instead of buckets: `first`, then"
        " `next_cursor` of the page before.",
        examples=["first"],
    ),
]


def trend_router(context: Context) -> APIRouter:
    """The route of trends."""
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
                description="Also a trend for each operating state, or for each cell along"
                " eccentricity or oil temperature.",
                examples=["state"],
            ),
        ] = None,
        max_points: Annotated[
            int,
            Query(ge=2, le=MAX_POINTS, description="More readings are gathered into buckets."),
        ] = 1000,
        cursor: Cursor = None,
    ) -> Response:
        """Quantities over time: single readings, or buckets with min, max, mean, count, quality.

        As CSV or Parquet, too: a row for each time, with `group_by` for each time of each group.
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
    """The trend, its groups, and until when the past is simulated."""
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    whole = context.store.trend(query)
    if group_by is None:
        return whole, None, past_end_ns
    try:
        return whole, trend_groups(context.store, query, group_by, grid), past_end_ns
    except TooManyGroupsError as error:
        raise ProblemError(422, "Wrong parameter", str(error), "group_by") from error


def _page_start_ns(cursor: str | None, group_by: GroupName | None, start_ns: int) -> int:
    """From when on to read."""
    if cursor is not None and group_by is not None:
        detail = "pages are of all readings, not of groups: leave out cursor or group_by"
        raise ProblemError(422, "Wrong parameter", detail, "cursor")
    return start_ns if cursor in (None, "first") else max(start_ns, int(cursor or 0))


def _known(quantities: list[str]) -> tuple[str, ...]:
    for name in quantities:
        if name not in BY_NAME:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
    return tuple(dict.fromkeys(quantities))
