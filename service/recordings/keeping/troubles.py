"""`Troubles`: steps that do not depend on each other, of which each may fail on its own."""

from collections.abc import Iterator
from contextlib import contextmanager

from service.store.port import StoreError


class Troubles:
    """Remembers the first thing that went wrong while the rest was done all the same.

    Attributes
    ----------
    first
        What went wrong first; None as long as nothing did.
    """

    def __init__(self) -> None:
        self.first: OSError | StoreError | None = None

    @contextmanager
    def borne(self) -> Iterator[None]:
        """Let a disk or the store refuse in here."""
        try:
            yield
        except (OSError, StoreError) as error:
            self.first = self.first or error

    def tell(self) -> None:
        """Raise what went wrong first, if anything did.

        Raises
        ------
        OSError
            If it was a disk.
        StoreError
            If it was the index.
        """
        if self.first is not None:
            raise self.first
