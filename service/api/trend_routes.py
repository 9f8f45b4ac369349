"""Trends of a bearing, whole or parted by condition."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Depends, Query

from core.condition.cells import CellGrid
from core.quantities import BY_NAME
from core.units import ns_from_s
from service.api.bearing_routes import TimeRange, eccentricity_range, oil_temperature_range
from service.api.context import BearingId, Context, UnitId
from service.api.film_conditions import states_named
from service.api.film_routes import States
from service.api.problems import ProblemError, problem_responses
from service.api.series_models import TrendModel
from service.api.trend_groups import GroupName, TooManyGroupsError, TrendGroup, trend_groups
from service.api.views import trend_columns, trend_model
from service.store.port import Trend, TrendQuery
from service.store.value_range import ValueRange

MAX_POINTS = 5000
MAX_QUANTITIES = 40
HOLE_HOPS = 2.5
"""Results further apart than this many refreshes have a hole between them."""


def trend_router(context: Context) -> APIRouter:
    """The route of trends."""
    router = APIRouter(prefix="/api/v1/units/{unit}/bearings", tags=["bearing"])
    reading = problem_responses(404, 422, 503)

    @router.get("/{bearing}/trends", summary="Trends", responses=reading)
    async def trends(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
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
    ) -> TrendModel:
        """Quantities over time: single readings, or buckets with min, max, mean, count, quality."""
        context.bearing(unit, bearing)
        query = TrendQuery(
            unit=unit,
            bearing=bearing,
            quantities=trend_columns(_known(quantity)),
            start_ns=times[0],
            end_ns=times[1],
            max_points=max_points,
            hole_ns=ns_from_s(HOLE_HOPS * context.refresh_s),
            eccentricity_ratio=eccentricity,
            oil_temperature_c=oil_temperature,
            states=states_named(state),
        )
        grid = context.films.settings.baseline.settings().grid
        return trend_model(query, *await asyncio.to_thread(_read, context, query, group_by, grid))

    return router


def _read(
    context: Context, query: TrendQuery, group_by: GroupName | None, grid: CellGrid
) -> tuple[Trend, list[TrendGroup] | None]:
    whole = context.store.trend(query)
    if group_by is None:
        return whole, None
    try:
        return whole, trend_groups(context.store, query, group_by, grid)
    except TooManyGroupsError as error:
        raise ProblemError(422, "Wrong parameter", str(error), "group_by") from error


def _known(quantities: list[str]) -> tuple[str, ...]:
    for name in quantities:
        if name not in BY_NAME:
            detail = f"quantity {name!r} is not in the catalogue; see /api/v1/quantities"
            raise ProblemError(422, "Wrong parameter", detail, "quantity")
    return tuple(dict.fromkeys(quantities))
