"""Spectra of a bearing over time."""

from typing import Annotated

import structlog
from fastapi import APIRouter, Query, Response

from service.api.auth.declared import needs
from service.api.bearing_routes import TimeRange
from service.api.context import BearingId, Context, UnitId
from service.api.problems import problem_responses
from service.api.rendering import rendered
from service.api.series_models import PlaceName
from service.api.spectra_models import SpectraModel
from service.api.spectra_views import spectra_model
from service.api.views import PLACES
from service.store.access.identities import Permission
from service.store.spectra_port import SpectraQuery

MAX_SPECTRA = 1000

log = structlog.get_logger()


def spectra_router(context: Context) -> APIRouter:
    """The route of spectra over time."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "/{bearing}/spectra",
        summary="Spectra over time",
        response_model=SpectraModel,
        responses=problem_responses(404, 422, 503),
    )
    async def spectra(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        channel: Annotated[
            list[PlaceName] | None,
            Query(
                max_length=8,
                description="Channels; all unless given. May be repeated.",
                examples=[["shaft_x"]],
            ),
        ] = None,
        max_spectra: Annotated[
            int,
            Query(ge=2, le=MAX_SPECTRA, description="Of more, some evenly in time are given."),
        ] = 200,
        max_frequency_hz: Annotated[
            float | None,
            Query(gt=0.0, allow_inf_nan=False, description="Highest frequency.", examples=[6.0]),
        ] = None,
    ) -> Response:
        """Averaged amplitude spectra as they were kept, all channels as displacement.

        Each is of one moment, not a mean or a maximum of all until the next.
        """
        context.bearing(unit, bearing)
        places = list(dict.fromkeys(channel or PLACES))
        query = SpectraQuery(unit, bearing, *times, max_spectra)
        return await rendered(lambda: _read(context, query, places, max_frequency_hz))

    return router


def _read(
    context: Context, query: SpectraQuery, places: list[PlaceName], max_frequency_hz: float | None
) -> SpectraModel:
    found = context.store.spectra.read(query)
    if found.damaged_ns:
        log.error(
            "spectra are damaged", unit=query.unit, bearing=query.bearing, n=len(found.damaged_ns)
        )
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    return spectra_model(query, found, places, max_frequency_hz, past_end_ns)
