"""Streamed downloads with limits on concurrent downloads and on concurrent work in threads."""

import asyncio
from collections.abc import AsyncIterator, Callable, Generator, Iterator
from typing import Any, TypeVar

from fastapi.responses import StreamingResponse

from service.api.problems import ProblemError

SLOTS = 2
"""Maximum number of evidence reports and download pieces that are produced concurrently."""

MAX_DOWNLOADS = 16
"""Maximum number of concurrent downloads; a download uses a slot only to produce a piece."""

T = TypeVar("T")


class Downloads:
    """Streamed downloads whose pieces are produced in threads as fast as clients read them."""

    def __init__(self) -> None:
        self._slots = asyncio.Semaphore(SLOTS)
        self._n = 0

    async def worked(self, do: Callable[[], T]) -> T:
        """Run a function in a thread as soon as one of the `SLOTS` is free; return its result."""
        async with self._slots:
            return await asyncio.to_thread(do)

    def require_room(self) -> None:
        """Check that fewer than `MAX_DOWNLOADS` downloads are in progress; reserve no place.

        Raises `ProblemError` with status 503 if `MAX_DOWNLOADS` downloads are in progress.
        """
        if self._n >= MAX_DOWNLOADS:
            detail = f"the maximum of {MAX_DOWNLOADS} downloads is reached; try again later"
            raise ProblemError(503, "Busy", detail)

    async def download(self, pieces: Generator[bytes, None, None]) -> AsyncIterator[bytes]:
        """Return an iterator over the pieces of a download; the first piece is produced at once.

        `pieces` is the generator of the pieces, which may block. Its errors for the first piece are
        raised here. Raises `ProblemError` with status 503 if `MAX_DOWNLOADS` downloads are in
        progress.
        """
        self.require_room()
        first = await self.worked(lambda: next(pieces, b""))  # the first piece opens all files
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


def attachment(
    pieces: AsyncIterator[bytes] | Iterator[bytes], media_type: str, name: str, **headers: str
) -> StreamingResponse:
    """Return a response that browsers save as a file `name`; `headers` are added to it."""
    saved = {"Content-Disposition": f'attachment; filename="{name}"'}
    nosniff = {"X-Content-Type-Options": "nosniff"}
    return StreamingResponse(pieces, media_type=media_type, headers=saved | nosniff | headers)


def file_content(
    media_type: str, description: str, schema: Any = None, **more: Any
) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI entry of an answer that is a file, binary unless it has a `schema`.

    `more` are further members of the description of the content, such as an example.
    """
    content = {"schema": schema or {"type": "string", "format": "binary"}, **more}
    return {200: {"description": description, "content": {media_type: content}}}
