"""Notes of people about a unit or a bearing at a time; the audit trail keeps them."""

import json
from dataclasses import dataclass
from typing import Annotated

from service.runtime.models import SERVED, NotServed, TimeNs
from service.store.access.audit_entries import AuditAction, acting
from service.store.audit import AuditQuery, AuditStore

NOTE_ADDED = "note.added"
"""Action in the audit trail; its object is the unit."""

MAX_NOTES = 1000
"""Maximum number of notes of a unit that are read; older notes remain in the audit trail."""


@dataclass(frozen=True)
class Note:
    """Note about a unit or a bearing, such as "shims changed"; notes are never changed."""

    __pydantic_config__ = SERVED

    unit: Annotated[str, NotServed]

    bearing: str | None
    """Identifier of the bearing; null for a note about the whole unit."""

    time_ns: TimeNs
    """Time to which the note refers."""

    text: str
    """Text of the note."""

    author: str
    """Person or API key that added the note."""


def note_action(note: Note, now_ns: int) -> AuditAction:
    """Return the audit entry that stores a note."""
    after = {"bearing": note.bearing, "time_ns": note.time_ns, "text": note.text}
    who = acting()
    return AuditAction(
        now_ns, note.author, NOTE_ADDED, note.unit, after=after, source=who.source, peer=who.peer
    )


def notes_between(audit: AuditStore, unit: str, start_ns: int, end_ns: int) -> list[Note]:
    """Return the notes of a unit that refer to a half-open time range, last added first."""
    entries = audit.entries(AuditQuery(limit=MAX_NOTES, action=NOTE_ADDED, object=unit))
    notes = (Note(unit=unit, author=e.actor, **json.loads(e.after or "{}")) for e in entries)
    return [note for note in notes if start_ns <= note.time_ns < end_ns]
