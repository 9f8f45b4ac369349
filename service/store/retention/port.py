"""What the program does with what is old: have it deleted, a little at a time."""

from collections.abc import Sequence
from typing import Protocol

from service.store.retention.limits import RetentionLimits


class RetentionStore(Protocol):
    """Deletes what is old. No others are held up for long, and every piece is all or nothing."""

    @property
    def trouble(self) -> str | None:
        """Why some of what is old cannot be deleted; None as far as all can."""
        ...

    def series(self) -> Sequence[int]:
        """Numbers of all bearings."""
        ...

    def believed_ns(self) -> int | None:
        """The newest time that a day of results lies behind; None if there are not so many."""
        ...

    def delete(self, series: int, limits: RetentionLimits, now_ns: int) -> bool:
        """Delete some of a bearing; whether there was anything to delete."""
        ...

    def prune(self, limits: RetentionLimits, now_ns: int) -> bool:
        """Delete some of what belongs to no bearing; whether there was anything to delete."""
        ...

    def give_back(self) -> bool:
        """Give some room that became free back to the disk; whether there is more of it."""
        ...
