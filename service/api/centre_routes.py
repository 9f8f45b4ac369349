"""The line that the shaft's centre draws in its bearing."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from core.units import ns_from_s
from service.api.auth.declared import needs
from service.api.bearing_routes import TimeRange, oil_temperature_range
from service.api.centre_models import CentreColumnModel, CentreLineModel
from service.api.context import BearingId, Context, UnitId
from service.api.film_conditions import states_named
from service.api.film_routes import States
from service.api.problems import problem_responses
from service.api.rendering import rendered, worked
from service.api.tables import Column, Format, table_content, table_response
from service.api.trend_routes import HOLE_HOPS, MAX_POINTS
from service.api.trend_tables import trend_table
from service.api.trend_views import bucket_s, simulated_until, times_s, trend_columns
from service.api.views import LEVEL_NAMES
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.port import Trend, TrendQuery
from service.store.series import U_RANDOM, U_SYSTEMATIC
from service.store.value_range import ValueRange

COLUMNS = {
    "x_um": "shaft_centre_x_um",
    "y_um": "shaft_centre_y_um",
    "eccentricity_ratio": "eccentricity_ratio",
    "attitude_angle_deg": "attitude_angle_deg",
}
"""Quantities by the names of the columns."""


def centre_router(context: Context) -> APIRouter:
    """The route of the shaft's centre."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "/{bearing}/shaft-centre",
        summary="Shaft centre line",
        response_model=CentreLineModel,
        responses={
            **problem_responses(404, 422, 503),
            **table_content("Shaft centre line, by column"),
        },
    )
    async def shaft_centre(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        wanted: Format,
        oil_temperature: Annotated[ValueRange, Depends(oil_temperature_range)],
        state: States = None,
        max_points: Annotated[
            int,
            Query(ge=2, le=MAX_POINTS, description="More readings are gathered into buckets."),
        ] = 1000,
    ) -> Response:
        """Where the shaft's centre was in its bearing, oldest first, with its uncertainty.

        As CSV or Parquet, too: a row for each time.
        """
        context.bearing(unit, bearing)
        query = TrendQuery(
            unit=unit,
            bearing=bearing,
            quantities=trend_columns(COLUMNS.values()),
            start_ns=times[0],
            end_ns=times[1],
            max_points=max_points,
            hole_ns=ns_from_s(HOLE_HOPS * context.refresh_s),
            oil_temperature_c=oil_temperature,
            states=states_named(state),
        )
        if wanted == "json":
            clearance_um = context.references.bearing(unit, bearing).clearance_um
            return await rendered(lambda: _line(context, query, clearance_um))
        columns = await worked(lambda: _table(context, query))
        return table_response(wanted, columns, f"shaft-centre-{unit}-{bearing}")

    return router


def _line(context: Context, query: TrendQuery, clearance_um: float) -> CentreLineModel:
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    trend = context.store.trend(query)
    return CentreLineModel(
        unit=query.unit,
        bearing=query.bearing,
        start=rfc3339(query.start_ns),
        end=rfc3339(query.end_ns),
        clearance_um=clearance_um,
        bucket_s=bucket_s(trend),
        simulated_until=simulated_until(query, past_end_ns),
        time=times_s(trend),
        **{name: _column(trend, quantity) for name, quantity in COLUMNS.items()},
    )


def _table(context: Context, query: TrendQuery) -> list[Column]:
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    return trend_table(context.store.trend(query), None, past_end_ns)


def _column(trend: Trend, quantity: str) -> CentreColumnModel:
    own = trend.series[quantity]
    return CentreColumnModel(
        mean=list(own.mean),
        u_random=list(trend.series[quantity + U_RANDOM].mean),
        u_systematic=list(trend.series[quantity + U_SYSTEMATIC].mean),
        worst_level=[None if level is None else LEVEL_NAMES[level] for level in own.worst_level],
    )
