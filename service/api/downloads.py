"""Downloads made piece by piece, and heavy work for answers: a little of either at once."""

import asyncio
from collections.abc import AsyncIterator, Callable, Generator
from typing import TypeVar

SLOTS = 2
"""Reports and pieces of downloads that are worked on at once."""

MAX_DOWNLOADS = 16
"""Downloads on their way at once; one that is read slowly takes a slot only for its next piece."""

T = TypeVar("T")


class TooManyDownloadsError(Exception):
    """No further download can be sent just now."""


class Downloads:
    """Makes downloads in threads, as fast as they are taken."""

    def __init__(self) -> None:
        self._slots = asyncio.Semaphore(SLOTS)
        self._n = 0

    async def worked(self, do: Callable[[], T]) -> T:
        """Do something in a thread, once a slot is free."""
        async with self._slots:
            return await asyncio.to_thread(do)

    def require_room(self) -> None:
        """Refuse a further download while many are on their way.

        Raises
        ------
        TooManyDownloadsError
            If there are `MAX_DOWNLOADS`.
        """
        if self._n >= MAX_DOWNLOADS:
            raise TooManyDownloadsError(f"{MAX_DOWNLOADS} bundles are on their way")

    async def download(self, pieces: Generator[bytes, None, None]) -> AsyncIterator[bytes]:
        """Send what is made piece by piece.

        Raises
        ------
        TooManyDownloadsError
            If too many are on their way; and what making the first piece raises.
        """
        self.require_room()
        first = await self.worked(lambda: next(pieces, b""))  # now all files are open
        return self._sent(first, pieces)

    async def _sent(
        self, piece: bytes, pieces: Generator[bytes, None, None]
    ) -> AsyncIterator[bytes]:
        self._n += 1
        try:
            while piece:
                yield piece
                piece = await self.worked(lambda: next(pieces, b""))
        finally:
            self._n -= 1
            pieces.close()
