"""References of a shaft centre, and reference vectors of 1×."""

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import Field

from service.api.auth.declared import needs, subject_router
from service.api.auth.gate import actor_or
from service.api.context import BearingId, Context, UnitId
from service.api.problems import ProblemError, problem_responses
from service.api.routes.bearings import Author, MicrometrePair, Note
from service.api.values import (
    ActorModel,
    ApiModel,
    BearingAnswer,
    ByName,
    NoteText,
    OperatingStateName,
    PlaceName,
    Time,
)
from service.measuring.references import VectorRefusedError, measured_vectors
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


class Order1ReferenceModel(BearingAnswer):
    """1× vectors of a healthy bearing."""

    state: Annotated[OperatingStateName, ByName]
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
    """Return the model of a stored reference."""
    return SetReferenceModel.of(reference, note=reference.note or None)


TAKE_PROBLEMS = problem_responses(
    403, 404, 422, 503, own={409: "The machine does not run in a condition for a reference"}
)


def reference_router(context: Context) -> APIRouter:
    """Return the routes of shaft-centre references and 1× reference vectors."""
    router = subject_router("/units/{unit}/bearings/{bearing}", "bearing")
    reading = problem_responses(404, 503)

    @router.get("/references", summary="References", responses=reading)
    async def references(unit: UnitId, bearing: BearingId) -> list[SetReferenceModel]:
        """List the references set for a bearing, newest first, at most a thousand.

        The newest is in force a few seconds after it was set; without any, the plant file applies.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.reference_history, unit, bearing)
        return [set_reference_model(reference) for reference in history]

    @router.get(
        "/order1-references", summary="References of 1×", responses=reading, name="references"
    )
    async def order1_references(unit: UnitId, bearing: BearingId) -> list[Order1ReferenceModel]:
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
    return Order1ReferenceModel.of(found, found.reference, note=found.note or None)
