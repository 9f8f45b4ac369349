"""Routes for gap references, which fix the shaft centre, and for reference vectors of 1×."""

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import Field

from service.api.auth.gate import actor_or, needs, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.problems import problem_responses
from service.api.routes.bearings import MicrometrePair
from service.api.values import (
    ActorModel,
    ApiModel,
    BearingAnswer,
    ByName,
    NoteOrNone,
    NoteText,
    OperatingStateName,
    PlaceName,
    Time,
)
from service.live.commands import TakeReference
from service.store.access.identities import Permission


class SetReferenceModel(ApiModel):
    """Stored gap reference of a bearing: probe gaps with the shaft centred."""

    set: Time
    author: str
    note: NoteOrNone

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] with the shaft centred, µm."""

    opposite_reference_um: MicrometrePair | None
    """Gaps of the probes across the shaft, µm; null without such probes."""

    source: Literal["given", "measured"]
    """Source: values entered by hand ("given"), or mean measured gaps ("measured")."""


class VectorModel(ApiModel):
    """Vibration vector of 1×: amplitude and phase."""

    amplitude_um_pk: Annotated[float, Field(examples=[61.2])]
    """Amplitude, µm zero-to-peak."""

    phase_deg: Annotated[float | None, Field(examples=[134.8])]
    """Phase lead over the key-phase pulse, degrees; null without a key-phase, when only amplitudes
    are compared."""


class Order1ReferenceModel(BearingAnswer):
    """Stored 1× reference of a bearing: vibration vectors in the healthy state."""

    set: Time
    author: str
    note: NoteOrNone

    state: Annotated[OperatingStateName, ByName]
    """Operating state to which the reference applies."""

    vectors: dict[PlaceName, VectorModel]
    """Reference vectors of 1×, by channel."""


class TakeReferenceModel(ActorModel):
    """Request to store the current 1× vectors of a bearing as reference."""

    note: NoteText = ""
    """Note, at most 500 printable characters."""


TAKE_PROBLEMS = problem_responses(own={409: "The present condition does not permit a reference"})


def reference_router(context: Context) -> APIRouter:
    """Return the router for gap references and 1× reference vectors."""
    router = subject_router("/units/{unit}/bearings/{bearing}", "bearing")

    @router.get("/references")
    async def gap_references(unit: UnitId, bearing: BearingId) -> list[SetReferenceModel]:
        """List the stored gap references of a bearing, newest first, at most 1000.

        The newest reference comes into force a few seconds after it was set. Without stored
        references, the reference of the plant file applies.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.gap_references.history, unit, bearing)
        return [SetReferenceModel.of(reference) for reference in history]

    @router.get("/order1-references", name="references")
    async def order1_references(unit: UnitId, bearing: BearingId) -> list[Order1ReferenceModel]:
        """List the stored 1× references of a bearing, newest first, at most 1000.

        In each operating state, the newest reference of this state applies. Without stored
        references, the reference of the plant file applies.
        """
        context.bearing(unit, bearing)
        history = await asyncio.to_thread(context.store.order1_references.history, unit, bearing)
        return [Order1ReferenceModel.of(found, found.reference) for found in history]

    @router.post(
        "/order1-references",
        responses=TAKE_PROBLEMS,
        dependencies=[needs(Permission.CHANGE_MEASURING)],
    )
    async def take_order1_reference(
        unit: UnitId, bearing: BearingId, asked: TakeReferenceModel
    ) -> Order1ReferenceModel:
        """Store the 1× vectors of the newest result as reference for its operating state."""
        context.bearing(unit, bearing)
        command = TakeReference(unit, bearing, actor_or(asked.actor), asked.note)
        taken = await context.operators.take_reference(command)
        return Order1ReferenceModel.of(taken, taken.reference)

    return router
