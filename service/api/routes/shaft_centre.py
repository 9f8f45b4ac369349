"""Line of the shaft centre in its bearing."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from core.units import ns_from_s
from service.api.answers import rendered, worked
from service.api.auth.declared import needs
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import States, TimeRange, oil_temperature_range
from service.api.problems import problem_responses
from service.api.routes.trends import (
    HOLE_HOPS,
    MAX_POINTS,
    bucket_s,
    simulated_until,
    times_s,
    trend_columns,
    trend_table,
)
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import LEVEL_NAMES, ApiModel, LevelName, Time, states_named
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.port import Trend, TrendQuery, ValueRange
from service.store.series import U_RANDOM, U_SYSTEMATIC


class CentreColumnModel(ApiModel):
    """One quantity of the shaft centre; one value per time."""

    mean: list[float | None]
    """Mean of the usable readings; null if there are none."""

    u_random: list[float | None]
    """Mean random standard uncertainty."""

    u_systematic: list[float | None]
    """Mean systematic standard uncertainty."""

    worst_level: list[LevelName | None]
    """Worst quality; null without readings."""


class CentreLineModel(ApiModel):
    """Line of the shaft centre in its bearing, oldest first, by column."""

    unit: str
    """Identifier of the unit."""

    bearing: str
    """Identifier of the bearing."""

    start: Time
    """Start of the requested range."""

    end: Time
    """End of the requested range."""

    clearance_um: float
    """Radius of the clearance circle, µm."""

    bucket_s: float | None
    """Width of the buckets, s; null for single readings."""

    simulated_until: Time | None
    """End of the simulated readings; null if all in this range are measured."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    x_um: CentreColumnModel
    """Shaft centre in x, µm."""

    y_um: CentreColumnModel
    """Shaft centre in y, µm."""

    eccentricity_ratio: CentreColumnModel
    """Eccentricity over clearance."""

    attitude_angle_deg: CentreColumnModel
    """Attitude angle, degrees."""


COLUMNS = {
    "x_um": "shaft_centre_x_um",
    "y_um": "shaft_centre_y_um",
    "eccentricity_ratio": "eccentricity_ratio",
    "attitude_angle_deg": "attitude_angle_deg",
}
"""Quantities by name of the column."""


def centre_router(context: Context) -> APIRouter:
    """Return the route of the shaft centre."""
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
            Query(ge=2, le=MAX_POINTS, description="More readings are combined in buckets."),
        ] = 1000,
    ) -> Response:
        """List the line of the shaft centre with its uncertainty, oldest first.

        As CSV or Parquet: one row per time.
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
