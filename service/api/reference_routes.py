"""The references of a bearing's shaft centre over time."""

import asyncio

from fastapi import APIRouter

from service.api.auth.declared import needs
from service.api.bearing_models import SetReferenceModel
from service.api.bearing_views import set_reference_model
from service.api.context import BearingId, Context, UnitId
from service.api.problems import problem_responses
from service.store.access.identities import Permission


def reference_router(context: Context) -> APIRouter:
    """Routes about references."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )
    reading = problem_responses(404, 503)

    @router.get("/{bearing}/references", summary="References", responses=reading)
    async def references(unit: UnitId, bearing: BearingId) -> list[SetReferenceModel]:
        """All references that were set for a bearing, newest first, at most the newest thousand.

        The first is in force a few seconds after it was set; without any, the plant file's is.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.reference_history, unit, bearing)
        return [set_reference_model(reference) for reference in history]

    return router
