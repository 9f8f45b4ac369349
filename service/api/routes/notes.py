"""Routes for notes about a unit or a bearing at a time."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Request
from pydantic import Field

from service.api.auth.gate import actor_or, needs, subject_router
from service.api.context import Context, UnitId
from service.api.parameters import Moment, OptionalTimeRange, ns_from_datetime
from service.api.routes.alarms import COMMENT_LIMIT, Allowances
from service.api.values import ActorModel, ReasonText
from service.store.access.identities import Permission
from service.store.notes import Note, notes_between


class AddNoteModel(ActorModel):
    """Request to add a note."""

    bearing: Annotated[str | None, Field(examples=["UJB"])] = None

    text: ReasonText
    """Text, 1 to 500 printable characters."""

    time: Annotated[Moment, Field(strict=False, examples=["2026-11-21T08:00:00Z"])]
    """Time to which the note refers, RFC 3339 with offset."""


def note_router(context: Context) -> APIRouter:
    """Return the router for notes."""
    router = subject_router("/units/{unit}/notes", "plant")
    allowances = Allowances()

    @router.get("")
    async def notes(unit: UnitId, times: OptionalTimeRange) -> list[Note]:
        """List the notes about a unit and its bearings that refer to a time range.

        Of a unit, the 1000 notes that were added last are listed, the newest first.
        """
        return await asyncio.to_thread(notes_between, context.store.audit, unit, *times)

    @router.post("", responses=COMMENT_LIMIT, dependencies=[needs(Permission.ACT_ON_ALARMS)])
    async def add_note(request: Request, unit: UnitId, asked: AddNoteModel) -> Note:
        """Add a note; the audit trail records it, and it is never changed or deleted."""
        if asked.bearing is not None:
            context.bearing(unit, asked.bearing)
        time_ns = ns_from_datetime(asked.time, "time")
        allowances.take(request, context.clock.monotonic_s())
        note = Note(unit, asked.bearing, time_ns, asked.text, actor_or(asked.actor))
        await context.operators.add_note(note)
        return note

    return router
