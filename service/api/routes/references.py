"""References of a shaft centre, and reference vectors of 1×."""

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import Field

from service.api.auth.declared import needs
from service.api.auth.gate import actor_or
from service.api.context import BearingId, Context, UnitId
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.routes.bearings import Author, MicrometrePair, Note
from service.api.values import (
    ActorModel,
    ApiModel,
    NoteText,
    OperatingStateName,
    PlaceName,
    Time,
)
from service.measuring.references_in_force import VectorRefusedError, measured_vectors
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.references import GapReference, SetVectorReference


class SetReferenceModel(ApiModel):
    """A stored reference."""

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] with the shaft centred."""

    opposite_reference_um: MicrometrePair | None
    """Gaps of the probes across the shaft; null without such probes."""

    source: Literal["given", "measured"]
    """Numbers given by hand, or the measured mean gaps when it was set."""

    set: Time
    """Time when it was set."""

    author: Author
    """Person who set it."""

    note: Note | None
    """Note of the author, if any."""


class VectorModel(ApiModel):
    """A 1× vector."""

    amplitude_um_pk: Annotated[float, Field(examples=[61.2])]
    """Amplitude, µm zero-to-peak."""

    phase_deg: Annotated[float | None, Field(examples=[134.8])]
    """Phase lead over the key-phase, degrees; null without a key-phase: then only the amplitude is
    compared."""


class Order1ReferenceModel(ApiModel):
    """1× vectors of a healthy bearing."""

    unit: str
    """Identifier of the unit."""

    bearing: str
    """Identifier of the bearing."""

    state: OperatingStateName
    """Operating state that it applies to."""

    vectors: dict[PlaceName, VectorModel]
    """Vectors by place."""

    set: Time
    """Time when it was set."""

    author: str
    """Person who set it."""

    note: str | None
    """Note of the author."""


class TakeReferenceModel(ActorModel):
    """Request to take the present 1× vectors as reference."""

    note: NoteText = ""
    """Note, at most 500 printable characters."""


def set_reference_model(reference: GapReference) -> SetReferenceModel:
    """A reference as it was set."""
    opposite = reference.opposite_reference_um
    return SetReferenceModel(
        gap_reference_um=list(reference.gap_reference_um),
        opposite_reference_um=None if opposite is None else list(opposite),
        source=reference.source.value,
        set=rfc3339(reference.set_ns),
        author=reference.author,
        note=reference.note or None,
    )


TAKE_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown unit or bearing",
        409: "The machine does not run in a condition for a reference",
        422: "A wrong parameter",
        503: "Not stored",
    }
)


def order1_reference_router(context: Context) -> APIRouter:
    """Return the routes of 1× reference vectors."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings/{bearing}",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "/order1-references", summary="References of 1×", responses=problem_responses(404, 503)
    )
    async def references(unit: UnitId, bearing: BearingId) -> list[Order1ReferenceModel]:
        """List the 1× references set for a bearing, newest first, at most a thousand.

        In each operating state the newest applies; without any, that of the plant file.
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
        """Store the 1× vectors of the newest result as reference for the operating state."""
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


def reference_router(context: Context) -> APIRouter:
    """Return the route of shaft-centre references."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )
    reading = problem_responses(404, 503)

    @router.get("/{bearing}/references", summary="References", responses=reading)
    async def references(unit: UnitId, bearing: BearingId) -> list[SetReferenceModel]:
        """List the references set for a bearing, newest first, at most a thousand.

        The newest is in force a few seconds after it was set; without any, the plant file applies.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.reference_history, unit, bearing)
        return [set_reference_model(reference) for reference in history]

    return router
