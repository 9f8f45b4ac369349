"""Reference vectors of 1× as the rest of the service sees them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from core.alarms.judgements import VectorReference


@dataclass(frozen=True)
class SetVectorReference:
    """A reference as somebody has set it; never changed, only followed by a newer one.

    Parameters
    ----------
    set_ns
        When, UTC.
    """

    reference: VectorReference
    set_ns: int
    author: str
    note: str = ""


class VectorReferenceStore(Protocol):
    """Reference vectors of 1×."""

    def add(self, reference: SetVectorReference) -> None:
        """Write a reference, which rules its bearing in its operating state; durable then."""
        ...

    def in_force(self) -> Sequence[SetVectorReference]:
        """Read the newest of every bearing and operating state."""
        ...

    def history(self, unit: str, bearing: str) -> Sequence[SetVectorReference]:
        """Read what was ever set for a bearing, newest first; at most the newest thousand."""
        ...
