"""Reference vectors of 1×: what they are, and taking new ones from the running machine."""

import asyncio

from fastapi import APIRouter

from service.api.auth.actors import actor_or
from service.api.auth.declared import needs
from service.api.context import BearingId, Context, UnitId
from service.api.order1_reference_models import (
    Order1ReferenceModel,
    TakeReferenceModel,
    VectorModel,
)
from service.api.problems import ProblemError, described_problems, problem_responses
from service.measuring.references_in_force import VectorRefusedError, measured_vectors
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.vector_reference_port import SetVectorReference

TAKE_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown unit or bearing",
        409: "The machine does not run so that a reference could be taken",
        422: "A wrong parameter",
        503: "Not stored",
    }
)


def order1_reference_router(context: Context) -> APIRouter:
    """Routes about reference vectors."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings/{bearing}",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "/order1-references", summary="References of 1×", responses=problem_responses(404, 503)
    )
    async def references(unit: UnitId, bearing: BearingId) -> list[Order1ReferenceModel]:
        """All 1× references that were set for a bearing, newest first, at most a thousand.

        In each operating state the newest rules; without any, that of the plant file.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.order1_references.history, unit, bearing)
        return [_model(found) for found in history]

    @router.post(
        "/order1-references",
        summary="Take a reference of 1×",
        responses=TAKE_PROBLEMS,
        dependencies=[needs(Permission.CHANGE_MEASURING)],
    )
    async def take(
        unit: UnitId, bearing: BearingId, asked: TakeReferenceModel
    ) -> Order1ReferenceModel:
        """Take the 1× vectors of the newest result as reference for the present operating state."""
        context.bearing(unit, bearing)
        current = context.live.current(unit, bearing)
        try:
            measured = measured_vectors(current.assessment if current.is_current else None)
        except VectorRefusedError as error:
            detail = f"unit {unit} bearing {bearing}: {error}"
            raise ProblemError(409, "No reference", detail) from error
        found = SetVectorReference(
            measured, context.clock.now_ns(), actor_or(asked.actor), asked.note
        )
        await asyncio.to_thread(context.store.order1_references.add, found)
        await context.operators.refer_to(measured)
        return _model(found)

    return router


def _model(found: SetVectorReference) -> Order1ReferenceModel:
    reference = found.reference
    return Order1ReferenceModel.model_validate(
        {
            "unit": reference.unit,
            "bearing": reference.bearing,
            "state": reference.state.name.lower(),
            "vectors": {
                place: VectorModel(amplitude_um_pk=v.amplitude_um_pk, phase_deg=v.phase_deg)
                for place, v in reference.vectors.items()
            },
            "set": rfc3339(found.set_ns),
            "author": found.author,
            "note": found.note or None,
        }
    )
