"""Downloads in pieces, and a limit on concurrent heavy work for answers."""

import asyncio
from collections.abc import AsyncIterator, Callable, Generator
from typing import TypeVar

SLOTS = 2
"""Maximum number of reports and pieces of downloads made concurrently."""

MAX_DOWNLOADS = 16
"""Maximum number of concurrent downloads; each takes a slot only while a piece is made."""

T = TypeVar("T")


class TooManyDownloadsError(Exception):
    """Too many concurrent downloads."""


class Downloads:
    """Makes downloads in threads, as fast as clients read them."""

    def __init__(self) -> None:
        self._slots = asyncio.Semaphore(SLOTS)
        self._n = 0

    async def worked(self, do: Callable[[], T]) -> T:
        """Run a function in a thread once a slot is free."""
        async with self._slots:
            return await asyncio.to_thread(do)

    def require_room(self) -> None:
        """Refuse a further download above the limit.

        Raises
        ------
        TooManyDownloadsError
            If there are `MAX_DOWNLOADS`.
        """
        if self._n >= MAX_DOWNLOADS:
            raise TooManyDownloadsError(f"{MAX_DOWNLOADS} downloads are in progress")

    async def download(self, pieces: Generator[bytes, None, None]) -> AsyncIterator[bytes]:
        """Return an iterator over the pieces of a download.

        Raises
        ------
        TooManyDownloadsError
            If there are too many downloads. Errors of the first piece are raised too.
        """
        self.require_room()
        first = await self.worked(lambda: next(pieces, b""))  # opens all files
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
