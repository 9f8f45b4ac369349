"""Route for the shaft centre line of a bearing."""

from fastapi import APIRouter, Response

from core.units import ns_from_s
from service.api.answers import in_thread, rendered
from service.api.auth.declared import subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import OilTemperature, States, TimeRange
from service.api.problems import problem_responses
from service.api.routes.trends import (
    HOLE_HOPS,
    MaxPoints,
    bucket_s,
    simulated_until,
    times_s,
    trend_columns,
    trend_table,
)
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import (
    ApiModel,
    BearingHistory,
    LevelName,
    Time,
    level_names,
    states_named,
)
from service.store.port import Trend, TrendQuery
from service.store.series import U_RANDOM, U_SYSTEMATIC


class CentreColumnModel(ApiModel):
    """Values of one coordinate of the shaft centre over time; every list has one value per time."""

    mean: list[float | None]
    """Mean of the usable readings; null without usable readings."""

    u_random: list[float | None]
    """Mean of the random standard uncertainties of the readings; null if unknown."""

    u_systematic: list[float | None]
    """Mean of the systematic standard uncertainties of the readings; null if unknown."""

    worst_level: list[LevelName | None]
    """Worst quality level of the readings; null without readings."""


class CentreLineModel(BearingHistory):
    """Shaft centre line of a bearing, oldest first, as one list per quantity."""

    clearance_um: float
    """Radius of the clearance circle, µm."""

    bucket_s: float | None
    """Width of the time intervals (buckets) that are averaged, s; null for single readings."""

    simulated_until: Time | None
    """End of the simulated readings; null if all readings in this range are measured."""

    time: list[float]
    """Time of each reading or start of each bucket, seconds since 1970 UTC."""

    x_um: CentreColumnModel
    """Position of the shaft centre in x, µm."""

    y_um: CentreColumnModel
    """Position of the shaft centre in y, µm."""

    eccentricity_ratio: CentreColumnModel
    """Eccentricity ratio: eccentricity divided by clearance."""

    attitude_angle_deg: CentreColumnModel
    """Attitude angle, degrees."""


COLUMNS = {
    "x_um": "shaft_centre_x_um",
    "y_um": "shaft_centre_y_um",
    "eccentricity_ratio": "eccentricity_ratio",
    "attitude_angle_deg": "attitude_angle_deg",
}
"""Names of the quantities in the catalogue, by field of `CentreLineModel`."""


def centre_router(context: Context) -> APIRouter:
    """Return the router for the shaft centre line."""
    router = subject_router("/units/{unit}/bearings", "bearing")

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
        oil_temperature: OilTemperature,
        state: States = None,
        max_points: MaxPoints = 1000,
    ) -> Response:
        """Return the shaft centre line with its uncertainty, oldest first.

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
        columns = await in_thread(lambda: _table(context, query))
        return table_response(wanted, columns, f"shaft-centre-{unit}-{bearing}")

    return router


def _line(context: Context, query: TrendQuery, clearance_um: float) -> CentreLineModel:
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    trend = context.store.trend(query)
    return CentreLineModel.of(
        query,
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
        worst_level=level_names(own.worst_level),
    )
