"""What a store knows of its own soundness: whether it is the newest, and what of it is damaged."""

from collections.abc import Sequence
from typing import Protocol

from service.store.highwater.comparison import MarkFinding
from service.store.seals import Place


class Integrity(Protocol):
    """Whether what is stored is what was stored."""

    @property
    def found(self) -> Sequence[MarkFinding]:
        """What was wrong with the database when it was opened, until it is adopted."""
        ...

    @property
    def mark_error(self) -> str | None:
        """Why the high-water mark could not be written last; None if it could."""
        ...

    @property
    def n_damaged(self) -> int:
        """Rows that were found damaged since the start, and are left out of what is read."""
        ...

    @property
    def damaged(self) -> Sequence[Place]:
        """Where they are, as far as places are remembered."""
        ...

    def require_file(self) -> None:
        """Raise `StoreError` if the database's file was removed or replaced since it was opened."""
        ...

    def adopt(self, now_ns: int) -> Sequence[MarkFinding]:
        """Go on with the database as it is, and tell the audit trail; what was wrong with it."""
        ...

    def check_some(self) -> bool:
        """Look at some rows behind those of the last time; whether that was once around."""
        ...


class Unmarked:
    """A store that looks after itself: a server's database, which has no file beside it."""

    found: Sequence[MarkFinding] = ()
    mark_error: str | None = None
    n_damaged: int = 0
    damaged: Sequence[Place] = ()

    def require_file(self) -> None:
        """There is no file that padwatch could look at."""

    def adopt(self, now_ns: int) -> Sequence[MarkFinding]:  # noqa: ARG002
        """Nothing is to be adopted."""
        return ()

    def check_some(self) -> bool:
        """Nothing is to be looked at."""
        return True
