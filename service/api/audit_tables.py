"""The audit trail as a table: a row for each entry."""

from collections.abc import Sequence

from service.api.tables import Column
from service.store.access.audit_entries import AuditEntry

TEXTS = (
    *("actor", "source", "peer", "action", "object", "before", "after", "reason"),
    *("previous_hash", "hash"),
)


def audit_table(entries: Sequence[AuditEntry]) -> list[Column]:
    """Columns of entries; what was before and after as JSON."""
    return [
        Column("number", "count", [entry.number for entry in entries]),
        Column("time_utc", "time", [entry.time_ns for entry in entries]),
        *(Column(name, "text", [getattr(entry, name) for entry in entries]) for name in TEXTS),
    ]
