"""How entries are chained: the hash of each covers the hash of the one before."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import astuple

from service.store.access.audit_entry import (
    MAX_NAME,
    MAX_REASON,
    AuditEntry,
    Deed,
    canonical,
    storable,
)

FORMAT = "padwatch-audit-1"

FIRST = "0" * 64
"""What the first entry has for the hash of the one before it."""


def digest(values: Sequence[object]) -> str:
    """SHA-256 of the columns of an entry without its own hash, in their order.

    Raises
    ------
    TypeError
        If one of them is neither text, number nor None.
    """
    text = json.dumps([FORMAT, *values], separators=(",", ":"))  # ASCII: one text for one list
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def chained(deed: Deed, number: int, previous_hash: str) -> AuditEntry:
    """A deed as the entry that follows another."""
    columns = (
        *(number, deed.time_ns, storable(deed.actor, MAX_NAME), deed.source.value),
        None if deed.peer is None else storable(deed.peer, MAX_NAME),
        *(storable(deed.action, MAX_NAME), storable(deed.object, MAX_NAME)),
        *(canonical(deed.before), canonical(deed.after), storable(deed.reason, MAX_REASON)),
        previous_hash,
    )
    return AuditEntry(*columns, digest(columns))


def recomputed(entry: AuditEntry) -> str | None:
    """The hash that an entry should have; None if it holds what no entry holds."""
    try:
        return digest(astuple(entry)[:-1])
    except TypeError:
        return None
