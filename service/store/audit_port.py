"""The audit trail as the rest of the service sees it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from service.store.access.audit_entries import AuditEntry, AuditAction


@dataclass(frozen=True)
class AuditQuery:
    """Which entries are wanted, newest first; None where anything will do.

    Parameters
    ----------
    before
        Only entries with lower numbers.
    limit
        Most entries that are read.
    start_ns, end_ns
        From the first, up to but not including the second.
    """

    before: int = 2**63 - 1
    limit: int = 100
    actor: str | None = None
    action: str | None = None
    object: str | None = None
    start_ns: int = -(2**63)
    end_ns: int = 2**63 - 1


class AuditStore(Protocol):
    """Who did what. Deeds in the store itself are written with what they change."""

    def record(self, deeds: Sequence[AuditAction]) -> None:
        """Write deeds that change nothing in the store; durable when this returns."""
        ...

    def entries(self, query: AuditQuery) -> Sequence[AuditEntry]:
        """Read entries, newest first."""
        ...

    @property
    def head_error(self) -> str | None:
        """Why the file beside the database could not be written last; None if it could."""
        ...
